"""Registration: the derivative of depth by pose, poses recovered, clear words where not."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from diagnosis.register.pose_derivative import pose_columns, travel_columns
from diagnosis.register.registration import PRIOR_SD, hits_normal, move, open_directions, register
from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.small_parts import VIEWS, datasheet, part, poses, record


def test_pose_columns_are_the_derivative_of_depth() -> None:
    # inside one flank of the roof depth is linear, so that differences are exact to second order
    scene, sheet = part("wedge"), datasheet(20)
    laser, scan = Laser.from_datasheet(sheet), poses(12, **VIEWS[1])
    hits = scene.cast(laser, scan)
    centre = np.array([1.0, -2.0, 3.0])
    normal, travel = hits_normal(scene, hits), travel_columns(scan)
    columns = pose_columns(scan, laser, hits.depth_mm, normal, centre, travel)
    for k, size in enumerate([1e-3] * 3 + [1e-5] * 3 + [1e-4] * 3):
        step = np.zeros(9)
        step[k] = size
        ahead = scene.cast(laser, move(scan, step, centre))
        back = scene.cast(laser, move(scan, -step, centre))
        same = (ahead.triangle == hits.triangle) & (back.triangle == hits.triangle)
        same &= np.isfinite(hits.depth_mm)
        slope = (ahead.depth_mm - back.depth_mm) / (2 * size)
        assert same.sum() > 100
        np.testing.assert_allclose(columns[..., k][same], slope[same], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("name", ["domes", "steps"])
def test_a_misplaced_part_is_found_again(name: str) -> None:
    scene, sheet = part(name), datasheet(100)
    laser = Laser.from_datasheet(sheet)
    made = record(scene, sheet, [], name="r", seed=4, profiles=70, pitch_mm=0.6, misplaced=6.0)
    valid = np.isfinite(made.depth_mm)
    placed = register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.003)
    residual = made.depth_mm - scene.cast(laser, placed.poses).depth_mm
    commanded = made.depth_mm - scene.cast(laser, made.poses).depth_mm
    known = np.isfinite(residual)
    # what is left is the noise, 9 µm in size; before, the misplacement was several times that
    assert np.median(np.abs(residual[known])) < 0.008
    assert np.sqrt(np.nanmean(np.clip(commanded, -1, 1) ** 2)) > 0.05
    assert (np.abs(residual[known]) > 0.3).mean() < 0.01  # silhouettes fall into place too


def test_silhouettes_are_searched_where_there_are_some(monkeypatch: pytest.MonkeyPatch) -> None:
    searched = []

    def search(cost: Any, count: int, reaches: Any) -> Any:
        searched.append(count)
        return np.zeros(count), 0.0

    monkeypatch.setattr("diagnosis.register.registration.step_by_step", search)
    monkeypatch.setattr("diagnosis.register.registration.OPEN", 0.0)
    sheet = datasheet(60)
    laser = Laser.from_datasheet(sheet)
    for name in ("domes", "steps"):
        scene = part(name)
        made = record(scene, sheet, [], name="r", seed=4, profiles=40, pitch_mm=0.5)
        valid = np.isfinite(made.depth_mm)
        register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.003)
        assert bool(searched) == (name == "steps")


@pytest.mark.parametrize(
    ("scale", "offset", "words"),
    [(1e-3, 0.0, "--part-unit m"), (1 / 25.4, 0.0, "--part-unit inch"), (1.0, 400.0, "overlap")],
)
def test_units_and_places_that_cannot_be(scale: float, offset: float, words: str) -> None:
    scene, sheet = part("domes"), datasheet(60)
    made = record(scene, sheet, [], name="r", seed=4, profiles=40, pitch_mm=1.0)
    wrong = Scene(scene.vertices_mm * scale + offset, scene.faces)
    laser, valid = Laser.from_datasheet(sheet), np.isfinite(made.depth_mm)
    with pytest.raises(RecipeError, match=words):
        register(wrong, made, laser, datasheet=sheet, valid=valid, sd_mm=0.003)


def test_a_sensor_that_sits_askew_is_registered_with_its_shear() -> None:
    scene, sheet = part("domes"), datasheet(100)
    laser = Laser.from_datasheet(sheet)
    askew = [{"name": "pose_error", "yaw_deg": 0.4, "pitch_deg": -0.3, "x_mm": 0.2}]
    made = record(scene, sheet, askew, name="r", seed=5, profiles=90, pitch_mm=0.4, speckle=None)
    valid = np.isfinite(made.depth_mm)
    placed = register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.002)
    residual = made.depth_mm - scene.cast(laser, placed.poses).depth_mm
    # 2 µm of repeatability and steps of 2 µm are left; a rigid part alone leaves tens
    assert np.sqrt(np.nanmean(residual**2)) < 0.004


def test_blurred_edges_are_registered_to_a_third_of_the_pitch() -> None:
    """Over 3.2 mm of way, eight pitches; what is read in shadows draws the part towards them."""
    scene, sheet = part("steps"), datasheet(100)
    laser = Laser.from_datasheet(sheet)
    blurred = [
        {"name": "camera_occlusion", "line_sd_um": 100.0, "weakest": 0.03},
        {"name": "motion_blur", "exposure_ms": 40.0, "stamped": "middle"},
    ]
    made = record(scene, sheet, blurred, name="r", seed=4, profiles=110, pitch_mm=0.4, **VIEWS[1])
    valid = np.isfinite(made.depth_mm)
    placed = register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.003)
    middle = np.array([0.0, 0.0, np.median(made.depth_mm[valid])])
    moved = (placed.poses[:, :3] - made.poses[:, :3]) @ np.append(middle, 1.0)
    assert np.linalg.norm(moved.mean(axis=0)) < 0.4 / 3


def test_a_noisy_face_still_says_where_the_part_lies() -> None:
    """Readings that scatter more are worth less, but are no outliers where that is known."""
    scene, sheet = part("wedge"), datasheet(100)
    laser = Laser.from_datasheet(sheet)
    made = record(scene, sheet, [], name="r", seed=4, profiles=70, pitch_mm=0.6)
    view = View(scene, SensorModel(sheet), made.poses, made.time_s, laser=laser)
    steep = np.abs(np.nan_to_num(view.slope_y)) > 0.2
    assert 0.4 < steep.mean() < 0.6
    spread = np.where(steep, 30.0, 1.0)
    shift = np.zeros(9)
    shift[1] = 0.2
    hits = scene.cast(laser, move(made.poses, shift, np.zeros(3)))
    noise = np.random.default_rng(1).normal(0.0, 0.009, steep.shape)
    moved = dataclasses.replace(made, depth_mm=hits.depth_mm + spread * noise)
    valid = np.isfinite(moved.depth_mm)

    def off(**known: Any) -> float:
        placed = register(scene, moved, laser, datasheet=sheet, valid=valid, sd_mm=0.009, **known)
        residual = hits.depth_mm - scene.cast(laser, placed.poses).depth_mm
        return float(np.sqrt(np.nanmean(residual[steep] ** 2)))

    # 0.27 mm a reading, 3800 of them
    assert off(spread=spread) < 0.005
    assert off() > 0.01


def test_silhouettes_say_where_a_part_lies_before_how_the_sensor_travels() -> None:
    """A bar that smooth faces leave open along the travel, whose length they leave open, too."""
    laser = Laser.from_datasheet(datasheet(40))
    place = poses(20)
    share = np.full(9, 1e-6)
    share[[1, 6]] = 1.0, 30.0
    unsure = np.diag((share * PRIOR_SD) ** 2)
    depth = np.full((20, 40), 100.0)
    assert len(open_directions(unsure, place, laser, depth, 0.3)) == 2
    (found,) = open_directions(unsure, place, laser, depth, 0.3, travels=False)
    assert np.abs(found[1]) == pytest.approx(1.0)
    assert found[6:] == pytest.approx([0.0, 0.0, 0.0])
    together = unsure.copy()
    together[1, 6] = together[6, 1] = 0.99999 * np.sqrt(unsure[1, 1] * unsure[6, 6])
    # for a given travel the bar's place is known to a hundredth of what it is otherwise
    (given,) = open_directions(together, place, laser, depth, 0.3, travels=False)
    assert np.abs(given[1]) == pytest.approx(1.0)
