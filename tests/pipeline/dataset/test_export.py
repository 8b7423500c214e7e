"""Exports say what the dataset says: read back, every number agrees."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import trimesh
from PIL import Image

import flawforge.dataset
from pipeline.dataset.export import PALETTE, code_depth, export
from sensors.casting.laser import Laser
from sensors.datasheet import Datasheet
from sensors.recording import Recording
from sensors.typed_yaml import RecipeError


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


def test_a_point_cloud_holds_the_valid_readings_with_their_labels(
    dataset: Path, tmp_path: Path
) -> None:
    scans = flawforge.dataset.open(dataset)
    (path,) = export(dataset, tmp_path, "ply", ["plate-0001-0000"])
    cloud = trimesh.load(path)
    assert isinstance(cloud, trimesh.PointCloud)
    expected = scans.points("plate-0001-0000")
    np.testing.assert_allclose(cloud.vertices, expected, rtol=0, atol=1e-5)
    data = cloud.metadata["_ply_raw"]["vertex"]["data"]
    scan = scans["plate-0001-0000"]
    valid = np.isfinite(scan["depth"])
    assert scan["mask"][valid].any(), "there is a flaw to look at"
    np.testing.assert_array_equal(data["label"].ravel(), scan["mask"][valid])
    np.testing.assert_array_equal(data["label_visible"].ravel(), scan["mask_visible"][valid])
    np.testing.assert_array_equal(data["instance"].ravel(), scan["instance"][valid])
    flawed = data["label"].ravel() == 1
    colours = np.stack([data[name].ravel() for name in ("red", "green", "blue")], axis=1)
    assert (colours[flawed] == PALETTE[1]).all()
    assert not (colours[~flawed] == PALETTE[1]).all(axis=1).any()


def test_images_give_depth_and_labels_back(small_dataset: Path, tmp_path: Path) -> None:
    scan = flawforge.dataset.open(small_dataset)["plate-0000-0001"]
    written = export(small_dataset, tmp_path, "png", ["plate-0000-0001"])
    names = {path.name.removeprefix("plate-0000-0001") for path in written}
    assert names == {"-depth.png", "-mask.png", "-mask-visible.png", "-instance.png", ".json"}
    coding = json.loads((tmp_path / "plate-0000-0001.json").read_text())["depth"]
    image = np.asarray(Image.open(tmp_path / "plate-0000-0001-depth.png"))
    assert image.dtype == np.uint16
    depth = np.where(image == 0, np.nan, coding["offset_mm"] + coding["scale_mm"] * image)
    np.testing.assert_allclose(depth, scan["depth"], rtol=0, atol=coding["scale_mm"])
    for name, key in (("mask", "mask"), ("mask-visible", "mask_visible")):
        picture = Image.open(tmp_path / f"plate-0000-0001-{name}.png")
        assert picture.mode == "P"
        np.testing.assert_array_equal(np.asarray(picture), scan[key])
        seen = np.asarray(picture.convert("RGB"))
        for number in np.unique(scan[key]):
            assert (seen[scan[key] == number] == PALETTE[int(number)]).all()
    instance = np.asarray(Image.open(tmp_path / "plate-0000-0001-instance.png"))
    np.testing.assert_array_equal(instance, scan["instance"])


@pytest.mark.parametrize("span_mm", [0.0, 1e-3, 5.0, 250.0, 1525.0])
def test_sixteen_bits_hold_any_range_to_half_a_step(span_mm: float) -> None:
    depth = 350.123456 + np.linspace(0.0, span_mm, 1001)[None]
    depth[0, 500] = np.nan
    numbers, coding = code_depth(depth)
    assert numbers[0, 500] == 0
    assert (np.delete(numbers[0], 500) > 0).all()
    again = coding["offset_mm"] + coding["scale_mm"] * np.delete(numbers[0], 500)
    error = np.abs(again - np.delete(depth[0], 500)).max()
    assert error <= coding["scale_mm"] / 2 * (1 + 1e-6)
    assert coding["scale_mm"] <= max(1e-4, span_mm / 32_000)


def test_a_scan_without_any_return_has_an_image_too() -> None:
    numbers, _ = code_depth(np.full((3, 4), np.nan))
    assert not numbers.any()


def test_what_cannot_be_exported_is_said_in_one_line(small_dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match=r"no such scan, got 'other'; allowed: plate-0000-0000"):
        export(small_dataset, tmp_path / "a", "ply", ["other"])
    assert not (tmp_path / "a").exists(), "nothing is written"
    with pytest.raises(RecipeError, match="no dataset here"):
        export(tmp_path, tmp_path / "b", "ply")
    with pytest.raises(RecipeError, match="got 'stl'; allowed: recording, ply, png"):
        export(small_dataset, tmp_path / "c", "stl")  # type: ignore[arg-type]  # on purpose


def test_a_missing_shard_is_said_in_one_line(small_dataset: Path, tmp_path: Path) -> None:
    table = pd.read_parquet(small_dataset / "manifest.parquet")
    table.to_parquet(tmp_path / "manifest.parquet")
    with pytest.raises(RecipeError, match=r"shard-00000\.h5: shard is missing or damaged"):
        export(tmp_path, tmp_path / "out", "png")
