"""Arithmetic of poses: rigid motions, travel signed by the sensor's y."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sensors.view.poses import displaced, to_part, travel_steps_mm, travelled_mm, turn_to_part


@pytest.fixture
def poses():
    rng = np.random.default_rng(0)
    out = np.repeat(np.eye(4)[None], 5, axis=0)
    out[:, :3, :3] = Rotation.random(5, random_state=0).as_matrix()
    out[:, :3, 3] = rng.normal(size=(5, 3))
    return out


@pytest.mark.parametrize("shape", [(5, 3), (5, 7, 3), (5, 2, 4, 3)])
def test_points_move_as_by_the_matrix_of_their_profile(poses, shape):
    points = np.random.default_rng(1).normal(size=shape)
    moved, turned = to_part(poses, points), turn_to_part(poses, points)
    for pose, before, after, only in zip(poses, points, moved, turned, strict=True):
        for p, q, v in zip(*(a.reshape(-1, 3) for a in (before, after, only)), strict=True):
            assert q == pytest.approx((pose @ [*p, 1.0])[:3])
            assert v == pytest.approx(pose[:3, :3] @ p)


def test_a_displaced_sensor_sees_points_displaced_the_other_way(poses):
    shift = np.random.default_rng(2).normal(size=(5, 3))
    before = poses.copy()
    np.testing.assert_allclose(to_part(displaced(poses, shift), -shift), poses[:, :3, 3])
    assert np.array_equal(poses, before)


def test_travel_is_the_path_length_signed_by_the_sensors_y():
    poses = np.repeat(np.eye(4)[None], 4, axis=0)
    poses[:, 0, 3] = [0.0, 3.0, 3.0, 0.0]
    poses[:, 1, 3] = [0.0, 4.0, 6.0, 2.0]
    assert travelled_mm(poses) == pytest.approx([0.0, 5.0, 7.0, 2.0])
    assert travel_steps_mm(poses) == pytest.approx([5.0, 2.0, -5.0, -5.0])
    assert np.array_equal(travel_steps_mm(poses[:1]), [0.0])
