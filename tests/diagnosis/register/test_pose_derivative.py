"""The derivative of depth by a placement, against differences and what moves nothing."""

import numpy as np

from diagnosis.register.placement import move
from diagnosis.register.pose_derivative import pose_columns, travel_columns, travel_vector
from diagnosis.register.registration import hits_normal
from sensors.casting.laser import Laser
from tests.support.small_parts import VIEWS, datasheet, part, poses


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


def test_a_flat_face_gets_deeper_by_the_cosines_of_a_shift() -> None:
    """A plane z = 0 seen straight from above: only its normal's shift and two turns count."""
    scan, laser = poses(12), Laser.from_datasheet(datasheet(20))
    shape = (12, 20)
    depth, normal = np.full(shape, 100.0), np.broadcast_to(-scan[0, :3, 2], (*shape, 3))
    centre = scan[:, :3, 3].mean(axis=0) + 100.0 * scan[0, :3, 2]
    columns = pose_columns(scan, laser, depth, normal, centre, travel_columns(scan))
    sensor = columns[..., :3] @ scan[0, :3, :3]
    np.testing.assert_allclose(sensor[..., :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(sensor[..., 2], -1.0)
    along_normal = columns[..., 3:6] @ scan[0, :3, 2]
    np.testing.assert_allclose(along_normal, 0.0, atol=1e-9)
    # neither a longer travel nor one askew in the plane is seen; one that climbs is
    np.testing.assert_allclose(columns[..., 6:8], 0.0, atol=1e-9)
    climbed = np.linalg.norm(travel_vector(scan), axis=1)
    np.testing.assert_allclose(np.abs(columns[..., 8]), np.broadcast_to(climbed[:, None], shape))
