"""Single rays that start where the laser hits: its mirror reflection, its way through the part."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sensors.view import View

Floats = NDArray[np.float64]

# Rays cast at a time, so that memory doesn't grow with the scan.
BLOCK_RAYS = 250_000
# How far off the surface a ray starts, so that it doesn't meet its own facet.
CLEARANCE_MM = 1e-5


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Mirror:
    """Where the light that a point reflects like a mirror meets the part again.

    Attributes
    ----------
    distance_mm : (n, m) way from the point to the facing wall; NaN without one
    apparent_mm : (n, m) depth as which the camera reads the second spot; NaN where it doesn't
        see it, or where no camera is stated
    """

    distance_mm: Floats
    apparent_mm: Floats


def mirror(view: "View") -> Mirror:
    """Follow the mirror reflection of every ray once.

    The second spot Q = (x, y, z) lies off the laser's plane; the camera at (0, κb, 0) sees it
    along a line that meets the plane at depth z / (1 - y / κb): that is the reading it pulls to.
    """
    distance = np.full(view.shape, np.nan)
    apparent = np.full(view.shape, np.nan)
    has_camera = view.datasheet.triangulation_angle_deg is not None
    offset = view.datasheet.camera_offset_mm if has_camera else 0.0
    for rows in _blocks(view):
        normal, points = view.normal[rows], view.part_mm[rows]
        ray = np.broadcast_to(view.ray, normal.shape)
        along = np.einsum("nmk,nmk->nm", normal, ray)[..., None]
        poses = view.poses[rows]
        turn = poses[:, :3, :3].transpose(0, 2, 1)
        out = (ray - 2 * along * normal) @ turn
        valid = view.valid[rows] & (along[..., 0] < 0)
        start = points[valid] + CLEARANCE_MM * (normal @ turn)[valid]
        if len(start) == 0:
            continue
        way, triangle = view.scene.first_hit(start, out[valid])
        block = np.full(valid.shape, np.nan)
        block[valid] = way
        distance[rows] = block
        if not has_camera:
            continue
        met = triangle >= 0
        row = np.nonzero(valid)[0][met]
        unit = out[valid][met]
        unit /= np.linalg.norm(unit, axis=1, keepdims=True)
        second = start[met] + way[met, None] * unit
        local = np.einsum("ikj,ik->ij", poses[row, :3, :3], second - poses[row, :3, 3])
        camera = poses[row, :3, 3] + poses[row, :3, 1] * offset
        facing = np.einsum("ik,ik->i", view.scene.normals[triangle[met]], camera - second) > 0
        seen = facing & ~view.scene.blocked(second, camera, triangle[met])
        reading = np.where(seen, local[:, 2] / (1.0 - local[:, 1] / offset), np.nan)
        found = np.full(len(start), np.nan)
        found[met] = reading
        block = np.full(valid.shape, np.nan)
        block[valid] = found
        apparent[rows] = block
    return Mirror(distance_mm=distance, apparent_mm=apparent)


def thickness_mm(view: "View") -> Floats:
    """Way of each ray from where it enters the part to where it leaves it, (n, m) mm."""
    thickness = np.full(view.shape, np.nan)
    for rows in _blocks(view):
        valid = view.valid[rows]
        if not valid.any():
            continue
        ray = np.broadcast_to(view.ray, (*valid.shape, 3)) @ view.poses[rows, :3, :3].transpose(
            0, 2, 1
        )
        way, _ = view.scene.first_hit(
            view.part_mm[rows][valid] + CLEARANCE_MM * ray[valid], ray[valid]
        )
        block = np.full(valid.shape, np.nan)
        block[valid] = way + CLEARANCE_MM
        thickness[rows] = block
    return thickness


def _blocks(view: "View") -> list[slice]:
    n, m = view.shape
    rows = max(1, BLOCK_RAYS // max(1, m))
    return [slice(start, min(start + rows, n)) for start in range(0, n, rows)]
