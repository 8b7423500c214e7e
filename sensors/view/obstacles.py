"""A map of obstacles between laser points and the camera: their least depth.

Only triangles that face away from some sight line can stop one that leaves a closed solid. Their
least depth is drawn, always on the safe side, into a grid over the leg's x-y plane, and into
coarser ones of it: the farther a line has come, the higher it is and the coarser the look.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.casting.section import Floats, Ints
from sensors.casting.sweep import turned

_PAD_MM = 1e-5  # far above rounding, far below a reading


class Obstacles(NamedTuple):
    """Least depth of obstacles over the x-y plane of a leg's axes.

    Attributes
    ----------
    least : (k,)
        Depths of all levels one after another, mm in the leg's axes; infinite where nothing is.
    offset, shape : (levels,), (levels, 2)
        Where each level begins in `least`, and its rows (y) and columns (x).
    corner : (2,)
        Least x and y of the grid, mm.
    cell : float
        Size of the finest cells, mm; those of level k are 2^k times as large.
    top : float
        Least depth of all, mm.
    """

    least: Floats
    offset: NDArray[np.int64]
    shape: NDArray[np.int64]
    corner: Floats
    cell: float
    top: float


def obstacles(
    vertices_mm: Floats, faces: Ints, frame: Floats, place: Floats,
    low: Floats, high: Floats, b: float, count: int,
) -> Obstacles | None:  # fmt: skip
    """Draw the map for one leg; None where it would be of no use.

    Parameters
    ----------
    vertices_mm, faces
        The mesh, part frame.
    frame, place : (3, 3), (n, 3)
        Rotation part -> sensor, and the sensor's places in its axes, mm.
    low, high : (3,)
        Least and largest x, x/depth and depth of the leg's hits.
    b
        y of the camera, signed, mm.
    count
        About how many points will be looked up.
    """
    if b == 0.0 or not low[2] > 0.0:
        return None
    x, y, z = turned(vertices_mm, frame)
    slant = np.array([low[1], high[1], *sorted((b / low[2], b / high[2]))])
    # All sight lines run inside this rectangle.
    least_xy = np.array([min(low[0], 0.0), min(b, 0.0)]) + place[:, :2].min(axis=0) - _PAD_MM
    most_xy = np.array([max(high[0], 0.0), max(b, 0.0)]) + place[:, :2].max(axis=0) + _PAD_MM
    least_xy = np.maximum(least_xy, [x.min() - _PAD_MM, y.min() - _PAD_MM])
    most_xy = np.minimum(most_xy, [x.max() + _PAD_MM, y.max() + _PAD_MM])
    extent = most_xy - least_xy
    if not (extent > 0).all():
        return None
    side = int(np.clip(np.sqrt(count), 16, 1024))
    cell = float(extent.max()) / side
    columns, rows = (int(c) for c in np.floor(extent / cell) + 1)
    grid = np.full((rows, columns), np.inf)
    deepest = high[2] + float(place[:, 2].max()) + _PAD_MM
    _draw(x, y, z, faces, slant, deepest, least_xy, cell, grid)
    levels = [grid]
    while levels[-1].size > 1:
        levels.append(_coarser(levels[-1]))
    sizes = np.array([level.size for level in levels])
    return Obstacles(
        least=np.concatenate([level.ravel() for level in levels]),
        offset=np.concatenate([[0], np.cumsum(sizes)[:-1]]),
        shape=np.array([level.shape for level in levels]),
        corner=least_xy,
        cell=cell,
        top=float(levels[-1][0, 0]),
    )


def _coarser(grid: Floats) -> Floats:
    """Least of each 2 by 2 cells."""
    rows, columns = grid.shape
    even = np.full((rows + rows % 2, columns + columns % 2), np.inf)
    even[:rows, :columns] = grid
    coarse: Floats = np.minimum(
        np.minimum(even[::2, ::2], even[::2, 1::2]), np.minimum(even[1::2, ::2], even[1::2, 1::2])
    )
    return coarse


@njit(cache=True, error_model="numpy")
def _draw(
    x: Floats, y: Floats, z: Floats, faces: Ints, slant: Floats, deepest: float,
    corner: Floats, cell: float, grid: Floats,
) -> None:  # fmt: skip
    """Lower the grid to the triangles that face away from a line along (-s, β, -1).

    `slant` holds the least and largest s and β; what lies beyond the deepest point, as a part's
    base does, stands in no line's way.
    """
    rows, columns = grid.shape
    x_low, y_low = corner[0] - 2 * _PAD_MM, corner[1] - 2 * _PAD_MM
    x_high = corner[0] + columns * cell + 2 * _PAD_MM
    y_high = corner[1] + rows * cell + 2 * _PAD_MM
    px, py, pz = np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(faces)):
        a, b, c = np.uint64(faces[t, 0]), np.uint64(faces[t, 1]), np.uint64(faces[t, 2])
        if min(z[a], z[b], z[c]) - _PAD_MM > deepest:
            continue
        if max(y[a], y[b], y[c]) < y_low or min(y[a], y[b], y[c]) > y_high:
            continue  # beside the grid
        if max(x[a], x[b], x[c]) < x_low or min(x[a], x[b], x[c]) > x_high:
            continue
        ux, uy, uz = x[b] - x[a], y[b] - y[a], z[b] - z[a]
        vx, vy, vz = x[c] - x[a], y[c] - y[a], z[c] - z[a]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        size = (abs(ux) + abs(uy) + abs(uz)) * (abs(vx) + abs(vy) + abs(vz))
        facing = (
            min(-nx * slant[0], -nx * slant[1]) + min(ny * slant[2], ny * slant[3]) - nz
        )  # fmt: skip
        if facing > 1e-9 * size * (1.0 + abs(slant[2]) + abs(slant[3])):
            continue
        for k in range(3):
            v = faces[t, k]
            px[k], py[k], pz[k] = x[v], y[v], z[v]
        gx, gy = -nx / nz, -ny / nz
        tilted = abs(nz) > 1e-3 * (abs(nx) + abs(ny))
        first = max(0, int(np.floor((min(py[0], py[1], py[2]) - _PAD_MM - corner[1]) / cell)))
        last = min(rows - 1, int(np.floor((max(py[0], py[1], py[2]) + _PAD_MM - corner[1]) / cell)))
        for row in range(first, last + 1):
            # The part of the triangle in this strip of cells.
            bottom = corner[1] + row * cell - _PAD_MM
            top = corner[1] + (row + 1) * cell + _PAD_MM
            x0, x1, z0 = np.inf, -np.inf, np.inf
            for k in range(3):
                i, j = (k, (k + 1) % 3) if py[k] <= py[(k + 1) % 3] else ((k + 1) % 3, k)
                if py[i] > top or py[j] < bottom:
                    continue
                height = py[j] - py[i]
                begin, end = 0.0, 1.0
                if height > 0.0:
                    begin = max(0.0, (bottom - py[i]) / height)
                    end = min(1.0, (top - py[i]) / height)
                for share in (begin, end):
                    xs = px[i] + share * (px[j] - px[i])
                    zs = pz[i] + share * (pz[j] - pz[i])
                    x0, x1, z0 = min(x0, xs), max(x1, xs), min(z0, zs)
            if x0 > x1:
                continue
            z0 -= _PAD_MM
            left = max(0, int(np.floor((x0 - _PAD_MM - corner[0]) / cell)))
            right = min(columns - 1, int(np.floor((x1 + _PAD_MM - corner[0]) / cell)))
            for column in range(left, right + 1):
                least = z0
                if tilted and right > left:
                    middle_x = corner[0] + (column + 0.5) * cell
                    middle_y = corner[1] + (row + 0.5) * cell
                    plane = pz[0] + gx * (middle_x - px[0]) + gy * (middle_y - py[0])
                    plane -= (abs(gx) + abs(gy)) * (0.5 * cell + _PAD_MM) + _PAD_MM
                    least = max(least, plane)
                grid[row, column] = min(grid[row, column], least)


@njit(cache=True)
def is_free(
    box: Floats, begin: float, end: float, reach: float, ratio: float, screen: Obstacles
) -> bool:
    """Whether lines from a box of points to a box of cameras stay nearer than every obstacle.

    Parameters
    ----------
    box : (4, 3)
        Least and greatest corner of the points' box and of the cameras', leg's axes, mm; the
        cameras nearer (z) than the points.
    begin, end
        The part of their way that is looked at, 0 at the point and 1 at the camera.
    reach
        How far the lines run along y, mm.
    ratio
        Length of a step as a share of the way gone.
    screen
        The map.
    """
    least, offset, shape, corner, cell, top = screen
    if box[3, 2] >= box[0, 2]:
        return False
    share = begin
    while share < end:
        # The deepest that the lines can be from here on.
        deepest = (1.0 - share) * box[1, 2] + share * box[3, 2] + _PAD_MM
        if deepest < top:
            return True
        step = max(cell, share * reach * ratio)
        then = min(end, share + step / reach)
        x0 = min(
            (1.0 - share) * box[0, 0] + share * box[2, 0],
            (1.0 - then) * box[0, 0] + then * box[2, 0],
        )
        x1 = max(
            (1.0 - share) * box[1, 0] + share * box[3, 0],
            (1.0 - then) * box[1, 0] + then * box[3, 0],
        )
        y0 = min(
            (1.0 - share) * box[0, 1] + share * box[2, 1],
            (1.0 - then) * box[0, 1] + then * box[2, 1],
        )
        y1 = max(
            (1.0 - share) * box[1, 1] + share * box[3, 1],
            (1.0 - then) * box[1, 1] + then * box[3, 1],
        )
        widest = max(x1 - x0, y1 - y0)
        level, size = 0, cell
        while level < len(offset) - 1 and 4.0 * size < widest:
            level += 1
            size *= 2.0
        rows, columns = shape[level, 0], shape[level, 1]
        first = max(0, int(np.floor((y0 - _PAD_MM - corner[1]) / size)))
        last = min(rows - 1, int(np.floor((y1 + _PAD_MM - corner[1]) / size)))
        left = max(0, int(np.floor((x0 - _PAD_MM - corner[0]) / size)))
        right = min(columns - 1, int(np.floor((x1 + _PAD_MM - corner[0]) / size)))
        for row in range(first, last + 1):
            for column in range(left, right + 1):
                if least[offset[level] + row * columns + column] <= deepest:
                    return False
        share = then
    return True
