"""Brightness of the line: closed form on a plate, albedo, saturation, one light with effects."""

import dataclasses

import numpy as np
import pytest

from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.line.brightness import LEVELS, Brightness
from sensors.model import SensorModel
from sensors.surface.reflectance import Patch, ReflectanceMap
from sensors.view.view import View

SHEET = Datasheet(
    name="s", working_distance_mm=100.0, z_range_mm=60.0, x_fov_mm=40.0, points_per_profile=81,
    z_resolution_um=1.0, profile_rate_hz=500.0, triangulation_angle_deg=30.0, columns="even_x",
)  # fmt: skip
ROWS = 5
CORNERS = np.array([[-90.0, -90, 0], [90, -90, 0], [90, 90, 0], [-90, 90, 0]])


def view_of(pitch_deg=0.0, reflectance=None, effects=()):
    """Return parallel rays onto a plane that is tilted about the line by turning the sensor."""
    turn = np.radians(180.0 + pitch_deg)
    poses = np.tile(np.eye(4), (ROWS, 1, 1))
    poses[:, 1:3, 1:3] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    poses[:, :3, 3] = -100 * poses[:, :3, 2]
    sensor = SensorModel(dataclasses.replace(SHEET, effects=effects))
    scene = Scene(CORNERS, np.array([[0, 1, 2], [0, 2, 3]]))
    return View(
        scene, sensor, poses, np.arange(ROWS) / 500, laser=Laser.from_datasheet(SHEET),
        reflectance=reflectance,
    )  # fmt: skip


@pytest.mark.parametrize("pitch_deg", [-15.0, 0.0, 10.0])
def test_plate_has_lamberts_cosine_and_the_lobe(pitch_deg):
    view = view_of(pitch_deg)
    half = view.half_vector_rad[0, 40]
    assert np.degrees(half) == pytest.approx(15 + pitch_deg, abs=1e-5)
    model = Brightness(exposure=0.1, matt=0.4, lobe_deg=12)
    lobe = np.exp(-((np.tan(half) / np.tan(np.radians(12))) ** 2))
    expected = 0.1 * (np.cos(np.radians(pitch_deg)) + 0.6 / 0.4 * lobe)
    level = model.levels(view)[0, 40]
    assert level == pytest.approx(LEVELS * min(expected, 1), abs=0.51)


def test_albedo_scales_and_saturation_clips():
    half_dark = ReflectanceMap(base=1.0, patches=(Patch(value=0.5, x_mm=(0, 50), y_mm=(-90, 90)),))
    levels = Brightness(exposure=0.4).levels(view_of(reflectance=half_dark))
    ends = sorted((int(levels[0][0]), int(levels[0][-1])))
    assert ends[1] == pytest.approx(2 * ends[0], abs=1.1)
    bright = Brightness(exposure=100.0).levels(view_of())
    assert (bright[0] == LEVELS).all()


def test_what_is_dark_in_the_picture_is_what_goes_missing():
    effect = {"name": "specular_dropout", "share": 0.9, "matt": 0.3, "lobe_deg": 10.0,
              "threshold": 0.3}  # fmt: skip
    shades = np.linspace(0.1, 1.0, 10)
    found = []
    for shade in shades:
        view = view_of(reflectance=ReflectanceMap(base=float(shade)), effects=(effect,))
        law = view.sensor.law(view, None)
        level = Brightness(exposure=0.3).levels(view)[2, 40]
        found.append((int(level), float(np.broadcast_to(law.p_missing, view.shape)[2, 40])))
    level, missing = np.array(found).T
    assert (np.diff(level) > 0).all()
    assert (np.diff(missing) < 0).all()
