"""The fan and the datasheet's derived figures against the formulas of formats and paper."""

import dataclasses
import math

import numpy as np
import pytest
import trimesh

from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet, with_effects

SHEET = Datasheet(
    name="s",
    working_distance_mm=400.0,
    z_range_mm=250.0,
    x_fov_mm=495.0,
    points_per_profile=101,
    z_resolution_um=3.8,
    profile_rate_hz=500.0,
    triangulation_angle_deg=30.0,
    camera_side="-y",
)


def test_field_of_view_is_that_of_the_papers_table():
    assert math.degrees(SHEET.fov_rad) == pytest.approx(63.5, abs=0.01)


def test_camera_sits_on_its_side():
    assert SHEET.camera_offset_mm == pytest.approx(-400 * math.tan(math.pi / 6))
    assert SHEET.camera_sign == -1


def test_even_angle_fan():
    laser = Laser.from_datasheet(SHEET)
    angles = np.arctan(laser.slope_x)
    np.testing.assert_allclose(np.diff(angles), SHEET.fov_rad / 100, rtol=1e-9)
    assert laser.slope_x[-1] * 400 == pytest.approx(495 / 2)
    assert laser.slope_x[0] == -laser.slope_x[-1]
    assert not laser.x_mm.any()
    assert np.linalg.norm(laser.directions, axis=1) == pytest.approx(np.ones(101))
    assert laser.directions[:, 0] == pytest.approx(np.sin(angles))


def test_the_fan_stands_on_the_optical_axis():
    """The fan at 12 mm is that of the origin, moved; a plate below is as far in each ray."""
    plain = Laser.from_datasheet(SHEET)
    moved = Laser.from_datasheet(dataclasses.replace(SHEET, optical_axis_x_mm=12.0))
    np.testing.assert_array_equal(moved.slope_x, plain.slope_x)
    assert (moved.x_mm == 12.0).all()
    depth = np.full(101, 400.0)
    np.testing.assert_allclose(moved.points_mm(depth) - plain.points_mm(depth), [[12, 0, 0]] * 101)
    plate = trimesh.creation.box((2000.0, 2000.0, 20.0))
    scene, pose = Scene(plate.vertices, plate.faces), np.diag([-1.0, 1.0, -1.0, 1.0])[None]
    pose[0, 2, 3] = 410.0
    np.testing.assert_allclose(scene.cast(moved, pose).depth_mm, 400.0)


def test_even_x_and_given_columns():
    sheet = dataclasses.replace(SHEET, columns="even_x")
    laser = Laser.from_datasheet(sheet, points=12)
    np.testing.assert_allclose(np.diff(laser.x_mm), 495 / 11)
    assert not laser.slope_x.any()
    given = np.array([3.0, 2.0, -1.0])
    assert (Laser.from_datasheet(sheet, x_mm=given).x_mm == given).all()
    with pytest.raises(RecipeError, match="monotone"):
        Laser.from_datasheet(sheet, x_mm=np.array([0.0, 1.0, 1.0]))
    with pytest.raises(RecipeError, match="even_x"):
        Laser.from_datasheet(SHEET, x_mm=given)


def test_depth_is_the_rays_parameter():
    laser = Laser.from_datasheet(SHEET)
    depth = np.linspace(300, 500, 101)
    points = laser.points_mm(depth)
    assert (points[:, 2] == depth).all()
    np.testing.assert_allclose(points[:, 0], depth * laser.slope_x)
    assert not points[:, 1].any()


def test_effects_replace_those_of_their_name():
    sheet = with_effects(SHEET, ({"name": "a", "k": 1}, {"name": "b"}))
    again = with_effects(sheet, ({"name": "a", "k": 2}, {"name": "c"}))
    assert [e["name"] for e in again.effects] == ["a", "b", "c"]
    assert again.effects[0]["k"] == 2


def test_what_the_maker_left_out_is_asked_for_by_name():
    sheet = dataclasses.replace(SHEET, triangulation_angle_deg=None)
    with pytest.raises(RecipeError, match="triangulation_angle_deg"):
        _ = sheet.camera_offset_mm


def test_file_round_trip(tmp_path):
    SHEET.save(tmp_path / "s.yaml")
    assert Datasheet.load(tmp_path / "s.yaml") == SHEET
    with pytest.raises(RecipeError, match="no such sensor"):
        Datasheet.load("no-such-preset")


def test_points_of_a_scan_lie_where_its_poses_put_them():
    """Two profiles of a sensor that looks down: x is mirrored, the second stands 3 mm further."""
    laser = Laser(x_mm=np.array([-1.0, 0.0, 2.0]), slope_x=np.array([0.0, 0.1, 0.0]))
    poses = np.tile(np.diag([-1.0, 1.0, -1.0, 1.0]), (2, 1, 1))
    poses[:, :3, 3] = [[0.0, 0.0, 100.0], [0.0, 3.0, 100.0]]
    depth = np.array([[90.0, 80.0, np.nan], [100.0, 100.0, 110.0]])
    points = laser.points_part_mm(depth, poses)
    nan = float("nan")
    expected = [
        [[1.0, 0.0, 10.0], [-8.0, 0.0, 20.0], [nan, nan, nan]],
        [[1.0, 3.0, 0.0], [-10.0, 3.0, 0.0], [-2.0, 3.0, -10.0]],
    ]
    np.testing.assert_allclose(points, expected, atol=1e-12)
