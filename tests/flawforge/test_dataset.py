"""The dataset reader, on shards written here by hand from the documented layout."""

import ast
import json
import multiprocessing
import pickle
import shutil
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest

import flawforge.dataset
from flawforge.dataset import Dataset, ShardError

PROFILES, POINTS = 6, 9
STEP_MM, FINE_MM, FIRST_MM = 0.0038, 5e-5, 275.0
SPLITS = ("train", "train", "val", "train", "test")


def true_depth_mm(number: int) -> np.ndarray:
    """Tilt a plane for each scan; one reading of each profile is missing."""
    y, x = np.mgrid[:PROFILES, :POINTS].astype(float)
    depth = 400.0 + number + 0.1 * x - 0.2 * y
    depth[np.arange(PROFILES), np.arange(PROFILES)] = np.nan
    return depth


def pose_of(number: int) -> np.ndarray:
    """Place the sensor above the part, looking down, turned about its axis, travelling along y."""
    angle = 0.3 * number
    poses = np.tile(np.eye(4), (PROFILES, 1, 1))
    turn = np.array(
        [[np.cos(angle), np.sin(angle), 0], [np.sin(angle), -np.cos(angle), 0], [0, 0, -1.0]]
    )
    poses[:, :3, :3] = turn
    poses[:, :3, 3] = turn @ [5.0, 0, -400.0] + np.arange(PROFILES)[:, None] * turn[:, 1] * 0.2
    return poses


def counts(depth_mm: np.ndarray, scale_mm: float, dtype: type) -> np.ndarray:
    coded = np.full(depth_mm.shape, np.iinfo(dtype).max, dtype=dtype)
    valid = np.isfinite(depth_mm)
    coded[valid] = np.rint((depth_mm[valid] - FIRST_MM) / scale_mm)
    return coded


def write_shard(path: Path, numbers: list[int]) -> None:
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "flawforge-shard"
        file.attrs["version"] = 1
        file.attrs["classes"] = json.dumps({"0": "background", "1": "dent"})
        depths = np.stack([true_depth_mm(number) for number in numbers])
        for name, scale, dtype in (
            ("depth", STEP_MM, np.uint16),
            ("depth_ideal", FINE_MM, np.uint32),
            ("depth_clean", FINE_MM, np.uint32),
        ):
            data = file.create_dataset(name, data=counts(depths, scale, dtype), compression="gzip")
            data.attrs["scale_mm"] = scale
            data.attrs["offset_mm"] = FIRST_MM
            data.attrs["missing"] = np.iinfo(dtype).max
        mask = np.zeros(depths.shape, np.uint8)
        mask[:, 2:4, 3:6] = 1
        file["mask"] = mask
        file["mask_visible"] = mask
        file["invalid_reason"] = np.isnan(depths).astype(np.uint8)
        file["instance"] = mask.astype(np.uint16) * np.uint16(40000)
        file["pose"] = np.stack([pose_of(number) for number in numbers])
        file["pose_true"] = file["pose"][:] + 1e-3 * np.eye(4, k=3)
        file["time"] = np.tile(np.arange(PROFILES) / 500.0, (len(numbers), 1))
        file["ray_x_mm"] = np.zeros((len(numbers), POINTS))
        file["ray_slope"] = np.tile(np.linspace(-0.5, 0.5, POINTS), (len(numbers), 1))
        file["scan_id"] = np.array([f"scan-{number}".encode() for number in numbers])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    write_shard(folder / "shard-00000.h5", [0, 1, 2])
    write_shard(folder / "shard-00001.h5", [3, 4])
    manifest = pd.DataFrame(
        {
            "scan_id": [f"scan-{number}" for number in range(5)],
            "part": ["0"] * 5,
            "split": SPLITS,
            "shard": ["shard-00000.h5"] * 3 + ["shard-00001.h5"] * 2,
            "row": [0, 1, 2, 0, 1],
            "n_flaws": [1] * 5,
        }
    )
    flaws = pd.DataFrame(
        {"scan_id": manifest["scan_id"], "instance": [40000] * 5, "kind": ["dent"] * 5}
    )
    for name, table in (("manifest", manifest), ("flaws", flaws)):
        table.to_parquet(folder / f"{name}.parquet")
        table.to_csv(folder / f"{name}.csv", index=False)
    info = {"seed": 7, "classes": {"0": "background", "1": "dent"}}
    (folder / "dataset.json").write_text(json.dumps(info))
    return folder


@pytest.fixture
def scans(folder: Path) -> Dataset:
    return flawforge.dataset.open(folder)


@pytest.fixture
def damaged(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "damaged"))


def test_depths_are_mm_with_nan_where_nothing_came_back(scans: Dataset) -> None:
    for number, scan in enumerate(scans):
        truth = true_depth_mm(number)
        np.testing.assert_array_equal(np.isnan(scan["depth"]), np.isnan(truth))
        np.testing.assert_allclose(scan["depth"], truth, rtol=0, atol=STEP_MM / 2 + 1e-9)
        np.testing.assert_allclose(scan["depth_ideal"], truth, rtol=0, atol=FINE_MM / 2 + 1e-9)
        assert scan["depth"].dtype == np.float64


def test_a_scan_holds_everything_of_its_shard(scans: Dataset) -> None:
    scan = scans[3]
    assert scan["scan_id"] == "scan-3"
    assert set(scan) == {
        "depth", "depth_ideal", "depth_clean", "mask", "mask_visible", "instance",
        "invalid_reason", "pose", "pose_true", "time", "ray_x_mm", "ray_slope", "scan_id",
    }  # fmt: skip
    assert scan["mask"].sum() == 6
    assert scan["instance"].max() == 40000, "instances above 32767 survive"
    assert scan["time"][1] == 1 / 500


def test_scans_are_found_by_number_from_the_end_and_by_id(scans: Dataset) -> None:
    assert len(scans) == 5
    assert scans[-1]["scan_id"] == scans[4]["scan_id"] == scans["scan-4"]["scan_id"] == "scan-4"
    assert scans[np.int64(2)]["scan_id"] == "scan-2"
    assert scans.index("scan-2") == 2
    for missing in (5, -6):
        with pytest.raises(IndexError, match=r"no scan .* there are 5"):
            scans[missing]
    with pytest.raises(KeyError):
        scans["scan-9"]


def test_a_slice_and_a_split_are_datasets_with_their_own_tables(scans: Dataset) -> None:
    assert [scan["scan_id"] for scan in scans[1:4]] == ["scan-1", "scan-2", "scan-3"]
    assert [scan["scan_id"] for scan in scans[::-2]] == ["scan-4", "scan-2", "scan-0"]
    train = scans.split("train")
    assert [scan["scan_id"] for scan in train] == ["scan-0", "scan-1", "scan-3"]
    assert list(train.flaws["scan_id"]) == ["scan-0", "scan-1", "scan-3"]
    assert train[-1]["scan_id"] == "scan-3"
    assert scans.splits == {"train": 3, "val": 1, "test": 1}
    assert sum(len(scans.split(name)) for name in scans.splits) == len(scans)
    with pytest.raises(KeyError, match="no split 'dev'; there are train, val, test"):
        scans.split("dev")


def test_tables_and_classes(scans: Dataset) -> None:
    assert scans.classes == {0: "background", 1: "dent"}
    assert scans.info["seed"] == 7
    assert list(scans.flaws_of(1)["kind"]) == ["dent"]
    assert list(scans.flaws_of("scan-1").index) == list(scans.flaws_of(1).index)


def test_only_the_fields_asked_for_are_read(folder: Path, damaged: Path) -> None:
    scans = flawforge.dataset.open(folder, fields=("depth", "mask"), dtype=np.float32)
    assert set(scans[0]) == {"depth", "mask"}
    assert scans[0]["depth"].dtype == np.float32
    assert set(scans.split("val")[0]) == {"depth", "mask"}
    with h5py.File(damaged / "shard-00000.h5", "a") as file:
        del file["pose_true"]
    flawforge.dataset.open(damaged, fields=("depth",))[0]
    with pytest.raises(ShardError, match=r"shard-00000.h5: holds no 'pose_true'; it holds depth"):
        flawforge.dataset.open(damaged, fields=("pose_true",))[0]


def test_raw_counts_and_their_coding_give_the_same_depths(folder: Path, scans: Dataset) -> None:
    raw = flawforge.dataset.open(folder, raw=True)
    code = raw.coding("depth")
    stored = raw[2]["depth"]
    assert stored.dtype == np.uint16
    assert raw[2]["instance"].dtype == np.uint16
    depth = code["offset_mm"] + code["scale_mm"] * stored
    depth[stored == code["missing"]] = np.nan
    np.testing.assert_array_equal(depth, scans[2]["depth"])
    assert raw.coding("mask") == {}
    np.testing.assert_array_equal(raw.points(2), scans.points(2))


def test_points_in_the_sensor_frame_lie_on_their_rays(scans: Dataset) -> None:
    scan = scans[1]
    valid = np.isfinite(scan["depth"])
    cloud = scans.points(1, frame="sensor")
    assert cloud.shape == (PROFILES * (POINTS - 1), 3)
    np.testing.assert_array_equal(cloud[:, 1], 0)
    np.testing.assert_array_equal(cloud[:, 2], scan["depth"][valid])
    slopes = np.broadcast_to(scan["ray_slope"], valid.shape)[valid]
    np.testing.assert_allclose(cloud[:, 0], cloud[:, 2] * slopes, rtol=1e-15)
    assert scan["mask"][valid].shape == (len(cloud),), "labels go with the points"


@pytest.mark.parametrize("pose", ["pose", "pose_true"])
def test_points_in_the_part_frame_are_each_profile_s_pose_applied(
    scans: Dataset, pose: str
) -> None:
    scan = scans[4]
    expected = []
    for profile in range(PROFILES):
        for point in range(POINTS):
            depth = scan["depth_clean"][profile, point]
            if np.isfinite(depth):
                sensor = [depth * scan["ray_slope"][point], 0.0, depth, 1.0]
                expected.append((scan[pose][profile] @ sensor)[:3])
    cloud = scans.points("scan-4", depth="depth_clean", pose=pose)
    np.testing.assert_allclose(cloud, expected, rtol=0, atol=1e-10)
    with pytest.raises(ValueError, match="frame must be"):
        scans.points(0, frame="world")  # type: ignore[arg-type]  # on purpose


def test_a_used_dataset_can_be_pickled(scans: Dataset) -> None:
    expected = scans[0]["depth"]
    again = pickle.loads(pickle.dumps(scans.split("train")))
    np.testing.assert_array_equal(again[0]["depth"], expected)


def _sum_of(job: tuple[Dataset, int]) -> float:
    scans, number = job
    return float(np.nansum(scans[number]["depth"]))


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_workers_read_what_the_parent_has_open(scans: Dataset, method: str) -> None:
    expected = [_sum_of((scans, number)) for number in range(5)]  # opens the files here first
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(method)) as pool:
        assert list(pool.map(_sum_of, [(scans, number) for number in range(5)])) == expected


def test_a_closed_dataset_opens_its_files_again(scans: Dataset) -> None:
    assert scans[0]["scan_id"] == "scan-0"
    scans.close()
    assert scans[0]["scan_id"] == "scan-0"


def test_it_reads_csv_where_there_is_no_parquet(damaged: Path, scans: Dataset) -> None:
    for path in damaged.glob("*.parquet"):
        path.unlink()
    again = flawforge.dataset.open(damaged)
    pd.testing.assert_frame_equal(again.manifest, scans.manifest, check_dtype=False)
    assert again.manifest["part"].iloc[0] == "0", "names stay texts"
    np.testing.assert_array_equal(again[4]["depth"], scans[4]["depth"])


class TestDamage:
    def test_no_dataset_there(self, tmp_path: Path) -> None:
        with pytest.raises(ShardError, match="no dataset here"):
            flawforge.dataset.open(tmp_path)

    def test_a_missing_shard_is_named_and_the_others_are_still_read(self, damaged: Path) -> None:
        (damaged / "shard-00001.h5").unlink()
        scans = flawforge.dataset.open(damaged)
        assert scans[2]["scan_id"] == "scan-2"
        with pytest.raises(ShardError, match=r"shard-00001\.h5: is missing"):
            scans[3]

    def test_a_truncated_shard(self, damaged: Path) -> None:
        path = damaged / "shard-00000.h5"
        path.write_bytes(path.read_bytes()[:-500])
        with pytest.raises(ShardError, match=r"shard-00000\.h5: is damaged or no HDF5 file"):
            flawforge.dataset.open(damaged)[0]

    def test_a_rotten_chunk(self, damaged: Path) -> None:
        path = damaged / "shard-00000.h5"
        with h5py.File(path) as file:
            chunk = file["depth"].id.get_chunk_info(0)
        data = bytearray(path.read_bytes())
        data[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
        path.write_bytes(data)
        with pytest.raises(ShardError, match=r"shard-00000\.h5: 'depth' of row 0 can't be read"):
            flawforge.dataset.open(damaged)[0]

    def test_another_kind_of_file(self, damaged: Path) -> None:
        with h5py.File(damaged / "shard-00000.h5", "a") as file:
            file.attrs["format"] = "profilometer-recording"
        with pytest.raises(ShardError, match="is no flawforge-shard up to version 1"):
            flawforge.dataset.open(damaged)[0]

    @pytest.mark.parametrize(
        ("column", "value", "message"),
        [("row", 7, "has 3 scans, the manifest wants row 7"), ("scan_id", "other", "'other'")],
    )
    def test_manifest_and_shard_that_disagree(
        self, damaged: Path, column: str, value: Any, message: str
    ) -> None:
        manifest = pd.read_parquet(damaged / "manifest.parquet")
        manifest.loc[0, column] = value
        manifest.to_parquet(damaged / "manifest.parquet")
        with pytest.raises(ShardError, match=message):
            flawforge.dataset.open(damaged)[0]

    def test_tables_that_cannot_be_read(self, damaged: Path) -> None:
        (damaged / "dataset.json").write_text("{")
        with pytest.raises(ShardError, match=r"dataset\.json: can't be read"):
            flawforge.dataset.open(damaged)
        (damaged / "manifest.parquet").write_bytes(b"PAR1")
        with pytest.raises(ShardError, match=r"manifest\.parquet: can't be read"):
            flawforge.dataset.open(damaged)
        pd.DataFrame({"scan_id": ["a"]}).to_parquet(damaged / "manifest.parquet")
        with pytest.raises(ShardError, match="no column row, shard"):
            flawforge.dataset.open(damaged)


def test_it_reads_what_the_generator_writes(small_dataset: Path) -> None:
    from pipeline.dataset.shards import read_scan

    scans = flawforge.dataset.open(small_dataset)
    assert len(scans) == 4
    assert scans.classes[1] == "dent"
    assert scans.splits == {"train": 2, "test": 2}
    for at, row in enumerate(scans.manifest.itertuples()):
        scan, written = scans[at], read_scan(small_dataset / str(row.shard), int(row.row))
        assert set(scan) == set(written)
        for name, values in scan.items():
            np.testing.assert_array_equal(values, written[name])
        np.testing.assert_array_equal(np.isnan(scan["depth"]), scan["invalid_reason"] > 0)
        own = scans.flaws_of(at).set_index("instance")
        assert own["pixels"].sum() == (scan["mask"] > 0).sum() > 0
        for number in np.unique(scan["instance"][scan["instance"] > 0]):
            labels = scan["mask"][scan["instance"] == number]
            assert {scans.classes[int(label)] for label in labels} == {own.loc[number, "kind"]}
        below = scans.points(at, depth="depth_clean", pose="pose_true")
        assert below[:, 2].max() <= 5.2, "on the plate of 5 mm, in its own frame"


def test_the_reader_needs_numpy_h5py_and_pandas_only() -> None:
    home = Path(flawforge.dataset.__file__).parent
    names = set()
    of_the_reader = ("flawforge.open_shard", "flawforge.shard_folder")
    for file in ("dataset.py", "open_shard.py", "shard_folder.py"):
        for node in ast.walk(ast.parse((home / file).read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module not in of_the_reader:
                names.add(str(node.module).split(".")[0])
    ours = {"flawforge", "pipeline", "sensors", "defects", "diagnosis", "challenge"}
    assert not names & ours
    assert names & {"torch", "scipy", "trimesh", "matplotlib"} == set()
    assert {"numpy", "h5py", "pandas"} <= names


def test_a_torch_loader_takes_it(scans: Dataset, folder: Path) -> None:
    data = pytest.importorskip("torch.utils.data")
    loader = data.DataLoader(
        flawforge.dataset.open(folder, dtype=np.float32), batch_size=2, num_workers=2
    )
    batches = list(loader)
    assert [len(batch["scan_id"]) for batch in batches] == [2, 2, 1]
    np.testing.assert_allclose(batches[1]["depth"][0].numpy(), scans[2]["depth"], atol=1e-4)
