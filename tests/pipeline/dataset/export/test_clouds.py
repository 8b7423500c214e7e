"""Recordings and point clouds say what the shards say, read by their own consumers."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import flawforge.dataset
from pipeline.dataset.export import export
from pipeline.preview.annotation import COLOURS
from sensors.casting.laser import Laser
from sensors.datasheet import Datasheet
from sensors.recording import Recording


@pytest.fixture(params=["small_dataset", "small_parallel_dataset"])
def dataset(request: pytest.FixtureRequest) -> Path:
    return Path(request.getfixturevalue(request.param))


def test_a_recording_holds_the_reading_and_the_commanded_poses(
    dataset: Path, tmp_path: Path
) -> None:
    written = export(dataset, tmp_path / "out", "recording")
    scans = flawforge.dataset.open(dataset)
    assert [path.name for path in written] == [
        *(f"{name}.h5" for name in scans.manifest["scan_id"]),
        "sensor.yaml",
    ]
    sheet = Datasheet.load(written[-1])
    for scan, path in zip(scans, written, strict=False):
        recording = Recording.load(path)
        assert recording.name == scan["scan_id"]
        np.testing.assert_array_equal(recording.depth_mm, scan["depth"].astype(np.float32))
        np.testing.assert_array_equal(recording.poses, scan["pose"])
        np.testing.assert_array_equal(recording.time_s, scan["time"])
        laser = Laser.from_datasheet(sheet, points=scan["depth"].shape[1], x_mm=recording.x_mm)
        np.testing.assert_allclose(laser.slope_x, scan["ray_slope"], rtol=0, atol=1e-15)
        np.testing.assert_allclose(laser.x_mm, scan["ray_x_mm"], rtol=0, atol=1e-12)


def test_trimesh_reads_the_ply(dataset: Path, tmp_path: Path) -> None:
    scans = flawforge.dataset.open(dataset)
    (path,) = export(dataset, tmp_path, "ply", ["plate-0001-0000"])
    cloud = trimesh.load(path)
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_allclose(
        cloud.vertices, scans.points("plate-0001-0000"), rtol=0, atol=1e-5
    )
    data = cloud.metadata["_ply_raw"]["vertex"]["data"]
    scan = scans["plate-0001-0000"]
    valid = np.isfinite(scan["depth"])
    assert scan["mask"][valid].any(), "there is a flaw to look at"
    np.testing.assert_array_equal(data["label"].ravel(), scan["mask"][valid])
    np.testing.assert_array_equal(data["instance"].ravel(), scan["instance"][valid])
    assert b"property int instance" in path.read_bytes()[:400], "an unsigned short is skipped"
    dents = data["label"].ravel() == 1
    colours = np.stack([data[name].ravel() for name in ("red", "green", "blue")], axis=1)
    dent = tuple(bytes.fromhex(COLOURS["dent"][1:]))
    assert (colours[dents] == dent).all()
    assert not (colours[~dents] == dent).all(axis=1).any()


def test_laspy_reads_the_las(dataset: Path, tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy")
    scans = flawforge.dataset.open(dataset)
    for path in export(dataset, tmp_path, "las"):
        cloud = laspy.read(path)
        scan = scans[path.stem]
        valid = np.isfinite(scan["depth"])
        assert cloud.header.version == "1.4"
        assert (cloud.header.scales <= 1e-6).all()
        np.testing.assert_allclose(
            cloud.xyz * 1e3, scans.points(path.stem), rtol=0, atol=0.51e-4
        )
        np.testing.assert_array_equal(cloud.classification, scan["mask"][valid])
        np.testing.assert_array_equal(cloud.instance, scan["instance"][valid])
        assert path.parent.name == scans.manifest["split"][scans.index(path.stem)]
