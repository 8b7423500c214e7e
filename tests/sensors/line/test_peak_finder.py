"""What a peak finder's threshold leaves of a moving line, against weights written out by hand."""

import numpy as np
import pytest
import trimesh

from sensors.casting.scene import Scene
from sensors.line import line_operator
from sensors.line.beam import read_beam
from sensors.line.line_operator import Line
from sensors.line.line_spread import line_spread
from sensors.line.peak_finder import above_threshold
from sensors.view.view import View

SD, WAY = 0.05, 4.0
TOP, FLOOR = 190.0, 200.0


def wall(view_of, run, y_mm):
    """Return a view at `y_mm` of a wall of 10 mm that ends at y = 10, `run` mm from its top."""
    outline = np.array([[0.0, -20.0], [15.0, -20.0], [15.0, 0.0], [10.0, 0.0], [10.0 - run, 10.0],
                        [0.0, 10.0]])  # fmt: skip
    solid = trimesh.creation.extrude_triangulation(
        outline, np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]]), 100.0
    )
    solid.apply_transform(np.array([[0, 0, 1.0, -50], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]))
    # a finder that reads everything in a column as one peak
    sheet = {"effects": ({"name": "edge_mixing", "line_sd_um": 50.0, "merge_um": 50000.0},)}
    view = view_of("plate", y_mm=[y_mm - 0.05, y_mm, y_mm + 0.05], sheet=sheet)
    scene = Scene(solid.vertices, solid.faces)
    return View(scene, view.sensor, view.poses, view.time_s)


def read(view, least, merge_mm=1e3) -> tuple[Line, Line]:
    line = line_spread(SD, -WAY / 2, WAY / 2, step_mm=1 / 64)
    before = read_beam(view, line)
    return before, above_threshold(view, line, before, least=least, merge_mm=merge_mm)


def shares(view, run, y_mm):
    """Light that the top, the wall and the floor send to the camera, from an even box."""
    ends = np.clip(np.array([-np.inf, 10 - run, 10, np.inf]), y_mm - WAY / 2, y_mm + WAY / 2)
    plate = np.cos(np.radians(30))
    normals = np.array([[0, 1.0], [10.0, max(run, 1e-9)], [0, 1.0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    middles = 0.5 * (ends[1:] + ends[:-1])
    depths = np.array([TOP, 195.0, FLOOR])
    to_camera = np.stack([200 * np.tan(np.radians(30)) + y_mm - middles, depths], axis=1)
    to_camera /= np.linalg.norm(to_camera, axis=1)[:, None]
    return np.diff(ends) / WAY * (normals * to_camera).sum(axis=1) / plate


def test_two_levels_lose_the_threshold_each(view_of):
    view = wall(view_of, 0.0, 10.6)
    top, _, floor = shares(view, 0.0, 10.6)
    for least in (0.0, 0.1, 0.2):
        _, after = read(view, least)
        counted = np.array([top - least, floor - least])
        mean = counted @ [TOP, FLOOR] / counted.sum()
        assert after.depth_mm[1, 40] == pytest.approx(mean, abs=0.1)
        share = counted[0] / counted.sum()
        assert after.spread_mm[1, 40] == pytest.approx(10 * np.sqrt(share * (1 - share)), abs=0.1)


def test_a_level_below_the_threshold_is_not_read(view_of):
    _, after = read(wall(view_of, 0.0, 11.7), 0.1)
    assert after.depth_mm[1, 40] == pytest.approx(FLOOR, abs=0.01)


def test_a_steep_wall_is_too_thin_to_count(view_of):
    """Its light is a quarter of all, over a hundred times the image's width."""
    view = wall(view_of, 1.0, 10.2)
    top, steep, floor = shares(view, 1.0, 10.2)
    before, after = read(view, 0.03)
    every = np.array([top, steep, floor])
    assert before.depth_mm[1, 40] == pytest.approx(every @ [TOP, 195, FLOOR] / every.sum(), abs=0.1)
    counted = np.array([top - 0.03, floor - 0.03])
    mean = counted @ [TOP, FLOOR] / counted.sum()
    assert after.depth_mm[1, 40] == pytest.approx(mean, abs=0.1)
    assert abs(mean - before.depth_mm[1, 40]) > 0.4


def test_peaks_apart_are_not_mixed(view_of):
    _, after = read(wall(view_of, 1.0, 10.2), 0.03, merge_mm=2.0)
    assert after.depth_mm[1, 40] == pytest.approx(FLOOR, abs=0.01)


def test_a_long_scan_is_read_in_blocks(view_of, monkeypatch):
    view = wall(view_of, 1.0, 10.2)
    _, whole = read(view, 0.03)
    monkeypatch.setattr(line_operator, "BLOCK_POINTS", 80)
    _, blocks = read(view, 0.03)
    assert np.array_equal(whole.depth_mm, blocks.depth_mm)
    assert np.array_equal(whole.spread_mm, blocks.spread_mm)


def test_a_slope_is_left_alone(view_of):
    view = view_of("plate", solid={"tilt_y_deg": 5.0}, y_mm=[0.0, 0.05, 0.1])
    before, after = read(view, 0.03)
    assert np.allclose(after.depth_mm, before.depth_mm, atol=0.01)


def test_one_unbroken_image_is_one_peak(view_of):
    """On a slope of 1, however small the gaps that the finder closes."""
    view = wall(view_of, 10.0, 5.0)
    _, whole = read(view, 1e-4)
    _, after = read(view, 1e-4, merge_mm=0.0)
    assert whole.spread_mm[1, 40] == pytest.approx(WAY / np.sqrt(12), rel=0.05)
    assert after.spread_mm[1, 40] == pytest.approx(whole.spread_mm[1, 40])
