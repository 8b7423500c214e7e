"""Single rays that start where the laser hits: its mirror reflection, its way through the part."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sensors.view.view import View

Floats = NDArray[np.float64]

# Rays cast at a time, so that memory doesn't grow with the scan.
BLOCK_RAYS = 250_000
# How far off the surface a ray starts, so that it doesn't meet its own facet.
CLEARANCE_MM = 1e-5
# Share of a second spot that a column must have to be pulled by it.
LEAST_SHARE = 0.05
# A first spot seen flatter than this (cosine) is as dark as one at it.
LEAST_COSINE = 0.05


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Mirror:
    """Second hits of the light that a point reflects specularly.

    Attributes
    ----------
    distance_mm : (n, m) path length to the facing wall; NaN without one
    landed_mm : (n, m) depth as which the camera reads second spots that fall into this column,
        their mean where there are several; NaN without one, or where no camera is stated
    landed_way_mm : (n, m) way from the first spot to them
    landed_light : (n, m) how bright the camera sees them beside the column's own first spot, where
        all light is reflected once and then scattered by a matt surface (Lambert's cosines)
    """

    distance_mm: Floats
    landed_mm: Floats
    landed_way_mm: Floats
    landed_light: Floats


def mirror(view: "View") -> Mirror:
    """Follow the mirror reflection of every ray once.

    The second spot Q = (x, y, z) lies off the laser's plane. The camera at (0, κb, 0) sees it
    along a line that meets the plane at Q / (1 - y / κb): there it biases the reading of the
    column of that position, which may differ from the spot's own column.
    """
    distance, depth, way, light = (np.full(view.shape, np.nan) for _ in range(4))
    has_camera = view.datasheet.triangulation_angle_deg is not None
    for rows in _blocks(view):
        normal = view.normal[rows]
        ray = np.broadcast_to(view.ray, normal.shape)
        along = np.einsum("nmk,nmk->nm", normal, ray)
        row, column = np.nonzero(view.in_range[rows] & (along < 0))
        if row.size == 0:
            continue
        turn = view.poses[rows, :3, :3][row]
        out = ray[row, column] - 2 * along[row, column, None] * normal[row, column]
        out = np.einsum("ijk,ik->ij", turn, out)
        lift = np.einsum("ijk,ik->ij", turn, normal[row, column])
        start = view.part_mm[rows][row, column] + CLEARANCE_MM * lift
        length, triangle = view.scene.first_hit(start, out)
        distance[rows][row, column] = length
        met = np.nonzero(triangle >= 0)[0]
        if has_camera and met.size:
            out = out[met] / np.linalg.norm(out[met], axis=1, keepdims=True)
            second = start[met] + length[met, None] * out
            _land(view, rows, row[met], second, triangle[met], length[met], depth, way, light)
    return Mirror(
        distance_mm=distance, landed_mm=depth, landed_way_mm=way, landed_light=light
    )


def _land(
    view: "View",
    rows: slice,
    row: NDArray[np.int64],
    second_mm: Floats,
    triangle: NDArray[np.int32],
    length_mm: Floats,
    depth: Floats,
    way: Floats,
    light: Floats,
) -> None:
    """Put second spots (k, 3), part frame, where the camera sees them."""
    offset = view.datasheet.camera_offset_mm
    poses = view.poses[rows][row]
    camera = poses[:, :3, 3] + poses[:, :3, 1] * offset
    cosine = _cosine(view.scene.normals[triangle], camera - second_mm)
    seen = np.nonzero(cosine > 0)[0]
    seen = seen[~view.scene.blocked(second_mm[seen], camera[seen], triangle[seen])]
    local = np.einsum("ikj,ik->ij", poses[seen, :3, :3], second_mm[seen] - poses[seen, :3, 3])
    image = local / (1.0 - local[:, 1:2] / offset)
    laser = view.laser
    if np.any(laser.slope_x):
        place, columns = (image[:, 0] - laser.x_mm.mean()) / image[:, 2], laser.slope_x
    else:
        place, columns = image[:, 0], laser.x_mm
    m = len(columns)
    order = np.argsort(columns)
    index = np.interp(place, columns[order], np.arange(m), left=-1.0, right=-1.0)
    inside = index >= 0
    # each spot is shared by the two columns beside it, so that spread spots leave no gaps
    left = np.minimum(index[inside].astype(np.int64), max(m - 2, 0))
    share = index[inside] - left
    column = order[np.concatenate([left, np.minimum(left + 1, m - 1)])]
    weight = np.concatenate([1.0 - share, share])
    target = np.tile(row[seen][inside], 2) * m + column
    size = (rows.stop - rows.start) * m
    held = np.bincount(target, weights=weight, minlength=size)

    def gathered(values: Floats) -> Floats:
        """Sum over the spots that share a column."""
        sums = np.bincount(target, weights=weight * np.tile(values, 2), minlength=size)
        return np.asarray(sums, dtype=np.float64)

    lit = held > LEAST_SHARE
    for values, out in ((image[inside, 2], depth), (length_mm[seen][inside], way)):
        mean = np.divide(gathered(values), held, out=np.full(size, np.nan), where=lit)
        out[rows] = mean.reshape(-1, m)
    first = _cosine(
        view.normal[rows], np.array([0.0, offset, 0.0]) - laser.points_mm(view.depth_mm[rows])
    )
    second = np.where(lit, gathered(cosine[seen][inside]), np.nan).reshape(-1, m)
    light[rows] = second / np.maximum(first, LEAST_COSINE)


def _cosine(normal: Floats, way: Floats) -> Floats:
    """Cosine between normals and ways, (...,)."""
    return np.asarray(np.einsum("...k,...k->...", normal, way) / np.linalg.norm(way, axis=-1))


def thickness_mm(view: "View") -> Floats:
    """Way of each ray from where it enters the part to where it leaves it, (n, m) mm."""
    thickness = np.full(view.shape, np.nan)
    for rows in _blocks(view):
        valid = view.in_range[rows]
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
