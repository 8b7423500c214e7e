"""Whether points lie inside a closed mesh: crossings of a ray, counted in double precision."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from defects.carving.bounding_box import bounding_box

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_AXES = np.linalg.qr(
    np.array([[0.83, 0.21, -0.37], [-0.19, 0.91, 0.29], [0.41, -0.33, 0.77]])
)[0]
"""The ray's direction is the last row: one that no drawing uses, so that rays miss edges."""

CELLS_PER_FACE = 9
"""Of a grid: small ones around few faces, since often many points are asked there."""

MOST_CELLS = 4000
"""Of a grid with several cells for a face."""


@njit(cache=True)
def _side(px: float, py: float, plane: Floats, a: int, b: int) -> bool:
    """Return on which side of the edge a-b the point is.

    Computed from the lower vertex, so that the two faces at an edge give strictly opposite
    answers, whatever the rounding.
    """
    low, high = min(a, b), max(a, b)
    turn = (plane[high, 0] - plane[low, 0]) * (py - plane[low, 1]) - (
        plane[high, 1] - plane[low, 1]
    ) * (px - plane[low, 0])
    return bool((turn >= 0.0) == (a < b))


@njit(cache=True)
def _write_sides(plane: Floats, face: Ints, low: Floats, half: float, side: Floats) -> None:
    """Write the factors of x, y and 1, and the least sum (3, 4), of each side of a triangle.

    For `_touches`, with x and y counted from `low`.
    """
    a, b, c = face[0], face[1], face[2]
    one = (plane[b, 0] - plane[a, 0]) * (plane[c, 1] - plane[a, 1])
    other = (plane[b, 1] - plane[a, 1]) * (plane[c, 0] - plane[a, 0])
    turn = 1.0 if one >= other else -1.0
    for k in range(3):
        ux, uy = turn * (plane[b, 0] - plane[a, 0]), turn * (plane[b, 1] - plane[a, 1])
        side[k, 0], side[k, 1] = -uy, ux
        side[k, 2] = uy * (plane[a, 0] - low[0]) - ux * (plane[a, 1] - low[1])
        side[k, 3] = -half * (abs(ux) + abs(uy))
        a, b, c = b, c, a


@njit(cache=True)
def _touches(side: Floats, x: float, y: float) -> bool:
    """Return whether a triangle's projection may touch a grid's cell around a place."""
    touches = True
    for k in range(3):
        touches &= side[k, 0] * x + side[k, 1] * y + side[k, 2] >= side[k, 3]
    return touches


@njit(cache=True)
def face_bins(plane: Floats, faces: Ints, low: Floats, cell: float, nx: int, ny: int) -> tuple[
    Ints, Ints
]:
    """List for each cell of a grid in the projection the faces that may touch it."""
    start, fill = np.zeros(nx * ny + 1, np.int32), np.zeros(nx * ny + 1, np.int32)
    members, side = np.empty(0, np.int32), np.empty((3, 4))
    half = 0.5 * cell * (1.0 + 1e-6)  # a place may be rounded into the next cell
    for sweep in range(2):
        for f in range(len(faces)):
            x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
            for v in range(3):
                x, y = plane[faces[f, v], 0], plane[faces[f, v], 1]
                x0, y0, x1, y1 = min(x0, x), min(y0, y), max(x1, x), max(y1, y)
            i0 = min(nx - 1, max(0, int((x0 - low[0]) / cell)))
            i1 = min(nx - 1, max(0, int((x1 - low[0]) / cell)))
            j0 = min(ny - 1, max(0, int((y0 - low[1]) / cell)))
            j1 = min(ny - 1, max(0, int((y1 - low[1]) / cell)))
            wide = i1 > i0 + 1 and j1 > j0 + 1
            if wide:
                _write_sides(plane, faces[f], low, half, side)
            for i in range(i0, i1 + 1):
                for j in range(j0, j1 + 1):
                    if wide and not _touches(side, (i + 0.5) * cell, (j + 0.5) * cell):
                        continue
                    if sweep == 0:
                        start[i * ny + j + 1] += 1
                    else:
                        members[fill[i * ny + j]] = f
                        fill[i * ny + j] += 1
        if sweep == 0:
            for at in range(1, len(start)):
                start[at] += start[at - 1]
                fill[at] = start[at]
            members = np.empty(start[-1], np.int32)
    return start, members


@njit(cache=True)
def _contains(
    points: Floats,
    plane: Floats,
    faces: Ints,
    low: Floats,
    high: Floats,
    cell: float,
    ny: int,
    start: Ints,
    members: Ints,
) -> NDArray[np.bool_]:
    inside = np.zeros(len(points), np.bool_)
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]):
            continue
        at = int((x - low[0]) / cell) * ny + int((y - low[1]) / cell)
        odd = False
        for m in range(start[at], start[at + 1]):
            a, b, c = faces[members[m], 0], faces[members[m], 1], faces[members[m], 2]
            if plane[a, 2] < z and plane[b, 2] < z and plane[c, 2] < z:
                continue
            first = _side(x, y, plane, a, b)
            if first != _side(x, y, plane, b, c) or first != _side(x, y, plane, c, a):
                continue
            ux, uy = plane[b, 0] - plane[a, 0], plane[b, 1] - plane[a, 1]
            vx, vy = plane[c, 0] - plane[a, 0], plane[c, 1] - plane[a, 1]
            det = ux * vy - uy * vx
            if det == 0.0:
                continue
            s = ((x - plane[a, 0]) * vy - (y - plane[a, 1]) * vx) / det
            t = (ux * (y - plane[a, 1]) - uy * (x - plane[a, 0])) / det
            height = (
                plane[a, 2] + s * (plane[b, 2] - plane[a, 2]) + t * (plane[c, 2] - plane[a, 2])
            )
            if height > z:
                odd = not odd
        inside[k] = odd
    return inside


@njit(cache=True)
def in_boxes(points_mm: Floats, boxes_mm: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """List which points lie in which boxes, in one pass over the points.

    Parameters
    ----------
    points_mm
        (k, 3); points that aren't finite lie in none.
    boxes_mm
        (b, 6) least and greatest corners.

    Returns
    -------
    start, member
        (b + 1,) and (s,): box i holds the points `member[start[i]:start[i + 1]]`, rising.
    """
    count = len(boxes_mm)
    start = np.zeros(count + 1, np.int64)
    member = np.empty(0, np.int64)
    hull = np.empty(6)
    for c in range(3):
        hull[c], hull[3 + c] = np.inf, -np.inf
        for b in range(count):
            hull[c] = min(hull[c], boxes_mm[b, c])
            hull[3 + c] = max(hull[3 + c], boxes_mm[b, 3 + c])
    for sweep in range(2):
        fill = start[:-1].copy()
        for k in range(len(points_mm)):
            x, y, z = points_mm[k, 0], points_mm[k, 1], points_mm[k, 2]
            if not (hull[0] <= x <= hull[3] and hull[1] <= y <= hull[4]):
                continue
            for b in range(count):
                if (
                    boxes_mm[b, 0] <= x <= boxes_mm[b, 3]
                    and boxes_mm[b, 1] <= y <= boxes_mm[b, 4]
                    and boxes_mm[b, 2] <= z <= boxes_mm[b, 5]
                ):
                    if sweep == 0:
                        start[b + 1] += 1
                    else:
                        member[fill[b]] = k
                        fill[b] += 1
        if sweep == 0:
            start = np.cumsum(start)
            member = np.empty(start[-1], np.int64)
    return start, member


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Inside:
    """A solid prepared for point-in-mesh tests; build by `Inside.of`."""

    faces: Ints
    plane: Floats
    low: Floats
    high: Floats
    cell_mm: float
    cells_y: int
    start: Ints
    members: Ints

    @classmethod
    def of(cls, vertices_mm: Floats, faces: Ints) -> Self:
        """Sort the faces of a closed mesh into a grid normal to the ray."""
        plane = np.ascontiguousarray(np.asarray(vertices_mm, np.float64) @ _AXES.T)
        faces = np.array(faces, dtype=np.int32, order="C")
        low, high = bounding_box(plane)
        span = high[:2] - low[:2]
        cells = max(len(faces), min(CELLS_PER_FACE * len(faces), MOST_CELLS))
        cell = max(float(np.sqrt(span[0] * span[1] / cells)), 1e-9)
        nx, ny = (int(n) for n in np.floor(span / cell) + 1)
        start, members = face_bins(plane, faces, low, cell, nx, ny)
        return cls(
            faces=faces, plane=plane, low=low, high=high, cell_mm=cell, cells_y=ny,
            start=start, members=members,
        )  # fmt: skip

    def contains(self, points_mm: Floats) -> NDArray[np.bool_]:
        """Return (k,) whether each of the points (k, 3), part frame, lies inside."""
        turned = np.ascontiguousarray(np.asarray(points_mm, np.float64) @ _AXES.T)
        inside: NDArray[np.bool_] = _contains(
            turned, self.plane, self.faces, self.low, self.high,
            self.cell_mm, self.cells_y, self.start, self.members,
        )  # fmt: skip
        return inside
