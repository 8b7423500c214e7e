"""Sight lines to the camera: the law of shadows, and the screen against every line searched."""

import numpy as np
import pytest
import trimesh

from sensors.casting.laser import Laser
from sensors.view.visibility import camera_visible
from tests.support.solids import LASERS, path, rotation, scene_of, solids

NAMES = [name for name, _ in solids(np.random.default_rng(0))]
FAN = Laser(x_mm=np.zeros(101), slope_x=np.tan(np.linspace(-0.2, 0.2, 101)))


def both_ways(scene, laser, poses, camera_mm):
    hits = scene.cast(laser, poses)
    seen = camera_visible(scene, laser, poses, hits, camera_mm)
    np.testing.assert_array_equal(
        seen, camera_visible(scene, laser, poses, hits, camera_mm, exhaustive=True)
    )
    return hits, seen


@pytest.mark.parametrize("laser", ["fan", "parallel", "backwards", "widening"])
@pytest.mark.parametrize("name", NAMES)
def test_the_screen_changes_nothing(name, laser):
    rng = np.random.default_rng([NAMES.index(name), list(LASERS).index(laser)])
    scene = scene_of(dict(solids(rng))[name])
    slight = trimesh.transformations.euler_matrix(*rng.normal(size=3) * 0.15)[:3, :3]
    for turned in (np.eye(3), slight, rotation(rng)):
        poses = path(np.zeros(3), 40, 61, turned=turned)
        for camera_mm in (58.0, -30.0, 3.0):
            hits, seen = both_ways(scene, LASERS[laser], poses, camera_mm)
            assert not seen[hits.triangle < 0].any()
            poses[:, :3, 3] += rng.normal(size=(61, 3)) * 0.2


def test_turning_paths_are_searched_too():
    scene = scene_of(dict(solids(np.random.default_rng(1)))["pockets"])
    poses = path(np.zeros(3), 20, 41)
    for k, angle in enumerate(np.linspace(-0.1, 0.1, 41)):
        poses[k, :3, :3] = trimesh.transformations.euler_matrix(angle, angle / 2, 0)[:3, :3]
    hits, seen = both_ways(scene, FAN, poses, 40.0)
    assert 0.3 < seen[hits.triangle >= 0].mean() < 1


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("floor_mm", [320.0, 400.0, 480.0])
def test_a_step_of_height_h_throws_a_shadow_of_h_b_over_z(sign, floor_mm):
    # Floor at depth z, a step of h on the camera's side from y = 0 on; b = 400 tan 30°.
    height, b, pitch = 12.0, 400 * np.tan(np.radians(30)), 0.05
    floor = trimesh.creation.box((400, 200, 20)).apply_translation((0, 0, 10))
    step = trimesh.creation.box((400, 90, 20)).apply_translation((0, sign * 45, 10 - height))
    scene = scene_of(trimesh.boolean.union([floor, step]))
    poses = path(np.array([0, -sign * (10 + pitch / 2), 0]), 10, 401, height_mm=floor_mm)
    hits, seen = both_ways(scene, FAN, poses, sign * b)
    on_floor = np.abs(hits.depth_mm - floor_mm) < 1e-9
    assert on_floor.all()
    shadow = (~seen).sum(axis=0) * pitch
    # The shadow's length is h tan θ with the angle at the floor, tan θ = b / z.
    np.testing.assert_allclose(shadow, height * b / floor_mm, atol=pitch)
    if floor_mm == 400:
        np.testing.assert_allclose(shadow, height * np.tan(np.radians(30)), atol=pitch)


def test_the_step_hides_nothing_from_a_camera_on_the_other_side():
    floor = trimesh.creation.box((400, 200, 20)).apply_translation((0, 0, 10))
    step = trimesh.creation.box((400, 90, 20)).apply_translation((0, 45, -2))
    scene = scene_of(trimesh.boolean.union([floor, step]))
    _, seen = both_ways(scene, FAN, path(np.array([0, -11.0, 0]), 10, 101, height_mm=400), -231.0)
    assert seen.all()


def test_a_wall_steeper_than_the_sight_line_is_hidden_and_a_flatter_one_seen():
    # Both slopes of a ridge; the camera at 30° sees the far one only if it falls by less than 60°.
    for slope_deg, visible in ((55, True), (65, False)):
        rise = 5 * np.tan(np.radians(slope_deg))
        ridge = trimesh.creation.extrude_triangulation(
            np.array([[-5.0, 0.0], [5.0, 0.0], [0.0, rise]]), np.array([[0, 1, 2]]), 100
        )
        # Profile in y-z, extruded along x; its top towards the sensor.
        turned = np.array([[0, 0, 1, -50], [1, 0, 0, 0], [0, -1, 0, rise / 2], [0, 0, 0, 1.0]])
        ridge.apply_transform(turned)
        if ridge.volume < 0:
            ridge.invert()
        poses = path(np.zeros(3), 4.9, 99, height_mm=400)
        hits, seen = both_ways(scene_of(ridge), FAN, poses, 400 * np.tan(np.radians(30)))
        y = np.linspace(-4.9, 4.9, 99)
        inner = (hits.triangle >= 0)[:, 40:60]
        assert inner.all()
        assert seen[y > 0.1, 40:60].all()
        assert (seen[y < -0.1, 40:60] == visible).all()


def test_nothing_is_hidden_on_a_plate():
    plate = scene_of(trimesh.creation.box((300, 300, 10)))
    tilt = trimesh.transformations.euler_matrix(0.2, 0.2, 0.2)[:3, :3]
    hits, seen = both_ways(plate, FAN, path(np.array([0, 0, -5.0]), 50, 101, turned=tilt), 58.0)
    assert (hits.triangle >= 0).all()
    assert seen.all()


def test_without_an_offset_the_camera_sees_what_the_laser_meets():
    scene = scene_of(dict(solids(np.random.default_rng(1)))["torus"])
    hits, seen = both_ways(scene, FAN, path(np.zeros(3), 30, 61), 0.0)
    np.testing.assert_array_equal(seen, hits.triangle >= 0)
