"""Registration: the derivative of depth by pose, poses recovered, clear words where not."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from diagnosis.register.placement import move
from diagnosis.register.registration import register
from sensors.casting.laser import Laser
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.small_parts import VIEWS, datasheet, part, record


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
