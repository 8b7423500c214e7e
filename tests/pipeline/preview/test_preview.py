"""Pictures: they come out whole, at the default choice, for every shape of scan."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from files.errors import RecipeError
from pipeline.dataset.shards import read_scan
from pipeline.parts.builtin import build
from pipeline.preview import scan_picture as preview
from pipeline.preview.annotation import spread
from pipeline.preview.chart import Chart
from pipeline.preview.cut import place_of_cut
from pipeline.preview.scan_picture import draw_scan, most_visible
from pipeline.preview.setup_picture import draw_setup
from sensors.datasheet import Datasheet


def ink(path: Path) -> float:
    """Share of pixels that aren't white."""
    image = np.asarray(Image.open(path).convert("RGB"))
    assert image.shape[0] > 600
    assert image.shape[1] > 1000
    return float((image < 250).any(axis=2).mean())


def test_a_scan_is_drawn(small_dataset: Path, tmp_path: Path) -> None:
    path = draw_scan(small_dataset, tmp_path / "scan.png")
    assert path == tmp_path / "scan.png"
    assert ink(path) > 0.25


def test_a_scan_that_saw_nothing_is_drawn_too(
    small_dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def blind(path: Path, row: int) -> dict[str, object]:
        scan = read_scan(path, row)
        for name in ("depth", "depth_ideal", "depth_clean"):
            scan[name] = np.full_like(scan[name], np.nan)
        for name in ("mask", "mask_visible", "instance"):
            scan[name] = np.zeros_like(scan[name])
        scan["invalid_reason"] = np.ones_like(scan["invalid_reason"])
        return scan

    monkeypatch.setattr(preview, "read_scan", blind)
    assert ink(draw_scan(small_dataset, tmp_path / "blind.png")) > 0.01


def test_the_default_is_the_scan_with_the_flaw_that_stands_out_most() -> None:
    manifest = pd.DataFrame({"scan_id": ["a", "b", "c"]})
    flaws = pd.DataFrame(
        {
            "scan_id": ["a", "b", "b", "c"],
            "pixels_visible": [50, 40, 0, 900],
            "deviation_over_noise": [3.0, 10.0, np.nan, 0.1],
        }
    )
    assert most_visible(manifest, flaws) == "b"
    assert most_visible(manifest, flaws[flaws["scan_id"] == "none"]) == "a"
    assert most_visible(manifest, flaws.assign(pixels_visible=0)) == "a"


def test_an_unknown_scan_or_folder_is_said_in_one_line(
    small_dataset: Path, tmp_path: Path
) -> None:
    with pytest.raises(RecipeError, match="no such scan, got 'other'; allowed: plate-0000-0000"):
        draw_scan(small_dataset, tmp_path / "x.png", scan_id="other")
    with pytest.raises(RecipeError, match="no dataset here"):
        draw_scan(tmp_path, tmp_path / "x.png")


def chart_of(x_mm: np.ndarray, travel_mm: np.ndarray) -> Chart:
    poses = np.tile(np.eye(4), (len(travel_mm), 1, 1))
    poses[:, 1, 3] = travel_mm
    scan = {
        "depth": np.ones((len(travel_mm), len(x_mm))),
        "ray_x_mm": x_mm,
        "ray_slope": np.zeros(len(x_mm)),
        "pose": poses,
    }
    return Chart.of(scan)


def test_an_image_puts_each_reading_where_it_lies() -> None:
    x_mm, travel_mm = np.array([0.0, 1.0, 2.0, 10.0]), np.array([0.0, 2.0, 4.0])
    chart = chart_of(x_mm, travel_mm)
    values = np.arange(12).reshape(3, 4)
    image = chart.image(values)
    left, right, bottom, top = chart.extent_mm
    assert (left, right, bottom, top) == (0, 10, 0, 4)
    for row, travel in enumerate(travel_mm):
        for column, x in enumerate(x_mm):
            v = round((travel - bottom) / (top - bottom) * (image.shape[0] - 1))
            u = round((x - left) / (right - left) * (image.shape[1] - 1))
            assert image[v, u] == values[row, column]
    share = (image == 3).sum() / image.size
    assert share == pytest.approx(0.4 * 0.25, rel=0.05), "the lonely column takes 6 to 10 mm"


def test_a_long_scan_lies_on_its_side_and_columns_may_run_backwards() -> None:
    chart = chart_of(np.array([3.0, 2.0, 1.0]), np.linspace(0, 30, 31))
    assert not chart.upright
    assert chart.extent_mm == (0, 30, 1, 3)
    image = chart.image(np.tile([30, 20, 10], (31, 1)))
    assert list(np.unique(image[0])) == [10], "x = 1 mm at the bottom"
    assert list(np.unique(image[-1])) == [30]


def test_no_thin_crack_is_lost_in_a_large_scan() -> None:
    chart = chart_of(np.linspace(0, 400, 4000), np.linspace(0, 200, 2000))
    labels = np.zeros((2000, 4000), np.uint8)
    labels[1234, 777] = 5
    assert chart.image(labels).shape == (750, 1500)
    assert chart.largest(labels).max() == 5
    assert (chart.largest(labels) > 0).sum() == 1


def test_a_cut_runs_across_the_flaw_where_it_is_deepest() -> None:
    chart = chart_of(np.arange(60.0), np.arange(40.0))
    here = np.zeros((40, 60), bool)
    here[10:20, 20:30] = True
    depth = np.where(here, 1.0, 0.0)
    depth[13] *= 2
    line, window, along = place_of_cut(here, depth, chart)
    assert (line, along) == (13, True)
    assert window.start < 20
    assert window.stop > 30
    along_x = np.zeros((40, 60), bool)
    along_x[12:14, 5:55] = True
    line, window, along = place_of_cut(along_x, np.where(along_x, 1.0, 0.0), chart)
    assert not along, "a groove along the line is cut across"
    assert window.start < 12
    assert window.stop > 14


def test_labels_are_pushed_apart() -> None:
    at = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [5.0, 5.0]])
    labels = spread(at + 1.0, at, 2.0)
    gaps = np.linalg.norm(labels[:, None] - labels[None], axis=2)[np.triu_indices(4, 1)]
    assert gaps.min() > 1.9
    assert np.linalg.norm(labels[3] - at[3]) < 2.5


def test_a_setup_is_drawn_with_and_without_flaws(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.preview.setup_picture.DPI", 75)
    part = build("steel_plate", length_mm=60, width_mm=40, thickness_mm=5, edge_radius_mm=2)
    poses = np.tile(np.diag([-1.0, 1.0, -1.0, 1.0]), (20, 1, 1))
    poses[:, :3, 3] = [0, 0, 250]
    poses[:, 1, 3] = np.linspace(-15, 15, 20)
    centre = part.vertices_mm[part.faces].mean(axis=1)
    top = centre[:, 2] > part.bounds_mm[1, 2] - 0.5
    instance = np.where(top & (centre[:, 0] > 10), 3, np.where(top & (centre[:, 0] < -10), 7, 0))
    shared = {
        "vertices_mm": part.vertices_mm,
        "faces": part.faces,
        "poses": poses,
        "datasheet": Datasheet.load("KEYENCE-LJ-X8200"),
        "title": "plate",
    }
    flawed = draw_setup(
        tmp_path / "a.png", instance=instance, kinds={3: "dent", 7: "other"}, **shared
    )
    clean = draw_setup(tmp_path / "b.png", instance=np.zeros(len(part.faces), int), **shared)
    assert ink(flawed) > ink(clean) > 0.02
    seen = np.asarray(Image.open(flawed).convert("RGB")).reshape(-1, 3).astype(int)
    for colour in ((230, 159, 0), (230, 0, 122)):
        near = np.abs(seen - colour).max(axis=1) < 30
        assert near.any(), "flaw and laser are there in their colours"
