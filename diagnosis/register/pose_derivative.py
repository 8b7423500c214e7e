"""Derivative of depth by a placement: where the part lies, and how the travel went."""

import numpy as np
from numba import njit

from diagnosis.fields import Field
from sensors.casting.laser import Laser

EDGE_ON = 1e-3
"""Least cosine of a facet's normal to a ray: beyond it, depth would move by any amount."""


def travel_vector(poses: Field) -> Field:
    """Each profile's way from the mean position, (n, 3), part frame, mm."""
    position = poses[:, :3, 3]
    return np.asarray(position - position.mean(axis=0))


def travel_columns(poses: Field) -> Field:
    """Return the derivative of each position by the travel's scale and turns, (n, 3, 3), mm."""
    return turned_ways(travel_vector(poses), poses)


def turned_ways(way: Field, poses: Field) -> Field:
    """Ways (n, 3), and as long along the sensor's x and z, (n, 3, 3)."""
    middle = poses[len(poses) // 2, :3, :3]
    along = way @ middle[:, 1]
    sideways, deeper = (along[:, None] * middle[None, :, k] for k in (0, 2))
    return np.stack([way, sideways, deeper], axis=-1)


def pose_columns(
    poses: Field,
    laser: Laser,
    depth_mm: Field,
    normal: Field,
    centre_mm: Field,
    travel: Field,
) -> Field:
    """Return the derivative of depth by the parameters of a placement, (n, m, 9).

    The point of a ray at fixed depth moves with the sensor by δ; the tangent plane at the hit
    with normal n then cuts the ray with direction v deeper by -n·δ / n·v.

    Parameters
    ----------
    normal : (n, m, 3)
        Outward normals at the hits, part frame.
    travel : (n, 3, 3)
        `travel_columns` of the whole recording, of these profiles: a strip's own would count from
        its own mean.
    """
    return np.asarray(
        _pose_columns(
            poses, laser.x_mm, laser.slope_x, depth_mm, np.ascontiguousarray(normal), centre_mm,
            travel,
        )
    )  # fmt: skip


@njit(cache=True)
def _pose_columns(
    poses: Field,
    x_mm: Field,
    slope_x: Field,
    depth_mm: Field,
    normal: Field,
    centre_mm: Field,
    travel: Field,
) -> Field:
    n, m = depth_mm.shape
    out = np.empty((n, m, 9))
    axis, arm, lever = np.empty(3), np.empty(3), np.empty(3)
    for i in range(n):
        for j in range(m):
            depth = 0.0 if np.isnan(depth_mm[i, j]) else depth_mm[i, j]
            facing = 0.0
            for k in range(3):
                axis[k] = poses[i, k, 2] + slope_x[j] * poses[i, k, 0]
                arm[k] = poses[i, k, 3] + x_mm[j] * poses[i, k, 0] + depth * axis[k]
                arm[k] -= centre_mm[k]
                facing += normal[i, j, k] * axis[k]
            if abs(facing) < EDGE_ON:
                facing = -EDGE_ON
            for k in range(3):
                lever[k] = -normal[i, j, k] / facing
                out[i, j, k] = lever[k]
            out[i, j, 3] = arm[1] * lever[2] - arm[2] * lever[1]
            out[i, j, 4] = arm[2] * lever[0] - arm[0] * lever[2]
            out[i, j, 5] = arm[0] * lever[1] - arm[1] * lever[0]
            for k in range(3):
                out[i, j, 6 + k] = (
                    lever[0] * travel[i, 0, k]
                    + lever[1] * travel[i, 1, k]
                    + lever[2] * travel[i, 2, k]
                )
    return out
