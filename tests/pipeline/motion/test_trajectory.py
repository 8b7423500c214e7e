"""Paths against their definition: steps of speed / rate, slerp, no padding."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from files.errors import RecipeError
from pipeline.motion.limits import Motion, Waypoint, WaypointPath
from pipeline.motion.trajectory import draw, follow, frame, poses_along, tilted
from quantity.distribution import Fixed, Uniform
from sensors.datasheet import Datasheet

SHEET = Datasheet(
    name="s",
    working_distance_mm=100.0,
    z_range_mm=50.0,
    x_fov_mm=50.0,
    points_per_profile=11,
    z_resolution_um=1.0,
    profile_rate_hz=500.0,
    travel_speed_mm_s=100.0,
)
DOWN = frame((0, 0, -1), (0, 1, 0))


def rigid(poses):
    turn = poses[:, :3, :3]
    np.testing.assert_allclose(turn @ turn.transpose(0, 2, 1), np.eye(3) + 0 * turn, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turn), 1)


def test_frame_is_right_handed_with_y_across_z_and_x():
    np.testing.assert_allclose(DOWN[:, 1], np.cross(DOWN[:, 2], DOWN[:, 0]))
    np.testing.assert_allclose(DOWN[:, 2], [0, 0, -1])
    np.testing.assert_allclose(DOWN[:, 1], [0, 1, 0])
    with pytest.raises(RecipeError, match="parallel"):
        frame((0, 0, 1), (0, 0, -2))


def test_tilts_turn_about_the_named_axes():
    np.testing.assert_allclose(tilted(DOWN, 0, 0, 30)[:, 2], DOWN[:, 2], atol=1e-15)
    np.testing.assert_allclose(tilted(DOWN, 0, 10, 0)[:, 0], DOWN[:, 0], atol=1e-15)
    np.testing.assert_allclose(tilted(DOWN, 10, 0, 0)[:, 1], DOWN[:, 1], atol=1e-15)


def test_straight_line_steps_by_speed_over_rate():
    ends = np.array([[0.0, 0, 0], [0, 30.0, 0]])
    poses, time = poses_along(ends, np.stack([DOWN, DOWN]), np.array([100.0]), 500.0, 151)
    np.testing.assert_allclose(np.diff(poses[:, 1, 3]), 0.2, rtol=1e-9)
    np.testing.assert_allclose(time, np.arange(151) / 500)
    assert (poses[:, :3, :3] == DOWN).all()
    rigid(poses)


def test_legs_have_their_own_speeds_and_turn_by_slerp():
    points = np.array([[0.0, 0, 0], [0, 10.0, 0], [0, 10.0, 20.0]])
    turned = tilted(DOWN, 0, 0, 40)
    poses, time = poses_along(
        points, np.stack([DOWN, DOWN, turned]), np.array([50.0, 200.0]), 100.0, 31
    )
    np.testing.assert_allclose(np.diff(poses[:20, 1, 3]), 0.5, rtol=1e-9)
    np.testing.assert_allclose(np.diff(poses[20:31, 2, 3]), 2.0, rtol=1e-9)
    middle = Rotation.from_matrix(DOWN.T @ poses[25, :3, :3]).magnitude()
    assert np.degrees(middle) == pytest.approx(20)
    assert (poses[:20, :3, :3] == DOWN).all()
    rigid(poses)
    assert time[-1] == pytest.approx(0.3)


def test_nothing_is_padded():
    ends = np.array([[0.0, 0, 0], [0, 1.0, 0]])
    with pytest.raises(RecipeError, match="6 of 7 profiles fit"):
        poses_along(ends, np.stack([DOWN, DOWN]), np.array([100.0]), 500.0, 7)


def test_waypoints_of_a_recipe():
    path = WaypointPath(
        waypoints=(
            Waypoint(at_mm=(0, -5, 100), speed_mm_s=50.0),
            Waypoint(at_mm=(0, 5, 100), yaw_deg=10.0),
        ),
        relative_to="part_centre",
    )
    way = follow(path, Motion(), SHEET, 50, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(way.poses[0, :3, 3], [1, -3, 103])
    np.testing.assert_allclose(np.diff(way.poses[:, 1, 3]), 0.1)
    rigid(way.poses)


def aim_at_origin(rng, reach):
    return np.zeros(3), 0


def drawn(rng=None, **limits):
    motion = Motion(**limits)
    return draw(motion, SHEET, 100, aim_at=aim_at_origin, rng=rng or np.random.default_rng(1))


def test_the_middle_of_the_path_looks_at_the_aim_from_the_working_distance():
    way = drawn(
        roll_deg=Fixed(value=7.0), pitch_deg=Fixed(value=-9.0), yaw_deg=Fixed(value=33.0),
        standoff_mm=Fixed(value=4.0),
    )  # fmt: skip
    middle = (way.poses[0] + way.poses[-1]) / 2
    np.testing.assert_allclose(middle[:3, 3] + 104 * middle[:3, 2], 0, atol=1e-9)
    rigid(way.poses)


def test_direction_is_apart_from_yaw():
    there, back = (drawn(direction=Fixed(value=d)) for d in (1.0, -1.0))
    np.testing.assert_allclose(there.poses[:, :3, 3], back.poses[::-1, :3, 3], atol=1e-12)
    assert (there.poses[:, :3, :3] == back.poses[:, :3, :3]).all()


def test_length_speed_and_rate_agree():
    for limits in (
        {"length_mm": Fixed(value=30.0)},
        {"speed_mm_s": Fixed(value=70.0)},
        {"length_mm": Fixed(value=30.0), "speed_mm_s": Fixed(value=20.0)},
        {"length_mm": Fixed(value=30.0), "speed_mm_s": Fixed(value=9e5)},
    ):
        way = drawn(**limits)
        facts = way.facts
        assert facts["length_mm"] == pytest.approx(
            100 * facts["speed_mm_s"] / facts["profile_rate_hz"]
        )
        step = np.linalg.norm(np.diff(way.poses[:, :3, 3], axis=0), axis=1)
        np.testing.assert_allclose(step, facts["speed_mm_s"] / facts["profile_rate_hz"])
        assert facts["profile_rate_hz"] <= SHEET.profile_rate_hz
        if "length_mm" in limits:
            assert facts["length_mm"] == pytest.approx(30.0)


def test_limits_are_kept():
    rng = np.random.default_rng(3)
    yaws = [drawn(rng, yaw_deg=Uniform(low=-20, high=5)).facts["yaw_deg"] for _ in range(200)]
    assert min(yaws) >= -20
    assert max(yaws) <= 5
    assert np.ptp(yaws) > 20


def test_a_rate_beyond_the_sensor_is_refused():
    with pytest.raises(RecipeError, match="profile_rate_hz"):
        drawn(profile_rate_hz=501.0)
