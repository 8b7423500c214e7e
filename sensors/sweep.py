"""The sweep: a straight scan of constant orientation, cast without a search.

Along such a leg every profile is the section of the part by a plane. Each triangle covers a run of
profiles, in each of them it is a segment, and the segment covers a run of points: a z-buffer over
(profile, point) collects the nearest. What counts as a hit, and its depth, is `sensors.section`'s
business, so the sweep and the Embree caster agree to the last bit.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.section import Floats, Ints, clipped, depth_on, edge_slope

_WAITING = 256  # segments found before their points are computed
_BLOCK = 16  # profiles whose part of the z-buffer stays in the processor's cache


def sweepable(x_mm: Floats, slope_x: Floats) -> bool:
    """Whether no two rays of the profile cross before the emitter, so that they keep an order."""
    dx, ds = np.diff(x_mm), np.diff(slope_x)
    return bool((dx >= 0).all() and (ds >= 0).all() or (dx <= 0).all() and (ds <= 0).all())


def sweep(
    vertices_mm: Floats, faces: Ints, frame: Floats, place: Floats, x_mm: Floats, slope_x: Floats
) -> tuple[Floats, Ints]:
    """Cast one leg.

    Parameters
    ----------
    vertices_mm, faces
        The mesh, part frame.
    frame : (3, 3)
        Rotation part -> sensor of the whole leg.
    place : (n, 3)
        Where the sensor stands in each profile, in `frame`'s axes, mm; in any order.
    x_mm, slope_x : (m,)
        Rays of a profile, for which `sweepable` holds.

    Returns
    -------
    depth_mm : (n, m) float64
        Depth of the first hit; NaN where there is none.
    triangle : (n, m) int32
        Its triangle, the lowest number among equals; -1 where there is none.
    """
    n, m = len(place), len(x_mm)
    backwards = x_mm[-1] < x_mm[0] or slope_x[-1] < slope_x[0]
    if backwards:
        x_mm, slope_x = x_mm[::-1].copy(), slope_x[::-1].copy()
    order = np.argsort(place[:, 1], kind="stable")
    sorted_place = place[order]
    x, y, z = turned(vertices_mm, frame)
    rows, row_origin, row_scale = _lookup(sorted_place[:, 1])
    low, high = _runs(
        x, y, z, faces, slope_x[0], slope_x[-1],
        sorted_place[:, 1].copy(), rows, row_origin, row_scale,
    )  # fmt: skip
    start, members = _blocks(low, high, n)
    # Rays sorted by the one number that tells them apart: their slope, or their place.
    kind, table, origin, scale = 2, np.zeros(2, dtype=np.int32), 0.0, 0.0
    if x_mm[0] == x_mm[-1]:
        kind, (table, origin, scale) = 0, _lookup(slope_x)
    elif slope_x[0] == slope_x[-1]:
        kind, (table, origin, scale) = 1, _lookup(x_mm)
    depth = np.empty((n, m))
    triangle = np.empty((n, m), dtype=np.int32)
    _fill(
        x, y, z, faces, low, high, start, members, sorted_place, order,
        x_mm, slope_x, kind, table, origin, scale, depth, triangle,
    )  # fmt: skip
    if backwards:
        depth, triangle = depth[:, ::-1].copy(), triangle[:, ::-1].copy()
    return depth, triangle


def _lookup(values: Floats) -> tuple[Ints, float, float]:
    """Table of where to begin the search in sorted `values`, at index (v - origin)·scale."""
    span = float(values[-1] - values[0])
    cells = 2 * len(values)
    scale = cells / span if span > 0 and math.isfinite(cells / span) else 0.0
    edges = values[0] + np.arange(cells + 1) / (scale if scale > 0 else 1.0)
    return np.searchsorted(values, edges).astype(np.int32), float(values[0]), scale


@njit(cache=True)
def turned(vertices: Floats, frame: Floats) -> tuple[Floats, Floats, Floats]:
    """Vertices in the leg's axes, in the order of operations of `section.turn`."""
    count = len(vertices)
    x, y, z = np.empty(count), np.empty(count), np.empty(count)
    for i in range(count):
        a, b, c = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        x[i] = frame[0, 0] * a + frame[0, 1] * b + frame[0, 2] * c
        y[i] = frame[1, 0] * a + frame[1, 1] * b + frame[1, 2] * c
        z[i] = frame[2, 0] * a + frame[2, 1] * b + frame[2, 2] * c
    return x, y, z


@njit(cache=True, inline="always")
def _guess(table: Ints, origin: float, scale: float, value: float) -> int:
    """Return about how many entries lie below `value`."""
    cell = (value - origin) * scale
    if not cell > 0.0:  # NaN too
        return int(table[0])
    last = len(table) - 1
    return int(table[np.uint64(cell)]) if cell < last else int(table[last])


@njit(cache=True)
def _runs(
    x: Floats, y: Floats, z: Floats, faces: Ints, slope_low: float, slope_high: float,
    profile_y: Floats, table: Ints, origin: float, scale: float,
) -> tuple[Ints, Ints]:  # fmt: skip
    """First profile that each triangle covers, and the one behind its last: ymin < y <= ymax.

    Triangles that show all rays their inner side cover none.
    """
    count, n = len(faces), len(profile_y)
    low, high = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    for t in range(count):
        i0, i1, i2 = faces[t, 0], faces[t, 1], faces[t, 2]
        a, b, c = y[i0], y[i1], y[i2]
        left, right = (b - a) * (z[i2] - z[i0]), (z[i1] - z[i0]) * (c - a)
        normal_x, size_x = left - right, abs(left) + abs(right)
        left, right = (x[i1] - x[i0]) * (c - a), (b - a) * (x[i2] - x[i0])
        normal_z, size_z = left - right, abs(left) + abs(right)
        away = min(normal_x * slope_low, normal_x * slope_high) + normal_z
        if away > 1e-9 * (size_x + size_z):
            low[t] = high[t] = 0
            continue
        bottom, top = min(a, b, c), max(a, b, c)
        i = _guess(table, origin, scale, bottom)
        while i > 0 and profile_y[i - 1] > bottom:
            i -= 1
        while i < n and profile_y[i] <= bottom:
            i += 1
        low[t] = i
        k = max(i, _guess(table, origin, scale, top))
        while k > i and profile_y[k - 1] > top:
            k -= 1
        while k < n and profile_y[k] <= top:
            k += 1
        high[t] = k
    return low, high


@njit(cache=True)
def _blocks(low: Ints, high: Ints, n: int) -> tuple[NDArray[np.int64], Ints]:
    """Triangles of each block of profiles, ascending, as one list with the starts of its runs."""
    blocks = (n + _BLOCK - 1) // _BLOCK
    start = np.zeros(blocks + 1, dtype=np.int64)
    for t in range(len(low)):
        if low[t] < high[t]:
            for b in range(low[t] // _BLOCK, (high[t] - 1) // _BLOCK + 1):
                start[b + 1] += 1
    for b in range(blocks):
        start[b + 1] += start[b]
    at = start[:-1].copy()
    members = np.empty(start[blocks], dtype=np.int32)
    for t in range(len(low)):
        if low[t] < high[t]:
            for b in range(low[t] // _BLOCK, (high[t] - 1) // _BLOCK + 1):
                members[at[b]] = t
                at[b] += 1
    return start, members


@njit(cache=True, inline="always", error_model="numpy")
def _left_of(
    x: float, z: float, x_mm: Floats, slope_x: Floats,
    kind: int, table: Ints, origin: float, scale: float,
) -> int:  # fmt: skip
    """How many rays pass left of (x, z), z >= 0: x_mm + slope_x·z < x."""
    m = len(x_mm)
    if kind == 0:
        j = _guess(table, origin, scale, (x - x_mm[0]) / z)
    elif kind == 1:
        j = _guess(table, origin, scale, x - slope_x[0] * z)
    else:
        j, top = 0, m
        while j < top:
            middle = (j + top) // 2
            if x_mm[middle] + slope_x[middle] * z < x:
                j = middle + 1
            else:
                top = middle
    # One step without a branch settles nearly all; the loops make sure.
    j = min(j, m - 1)
    if x_mm[np.uint64(j)] + slope_x[np.uint64(j)] * z < x:
        j += 1
    while j > 0 and not x_mm[np.uint64(j - 1)] + slope_x[np.uint64(j - 1)] * z < x:
        j -= 1
    while j < m and x_mm[np.uint64(j)] + slope_x[np.uint64(j)] * z < x:
        j += 1
    return j


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    x: Floats, y: Floats, z: Floats, faces: Ints, low: Ints, high: Ints,
    start: NDArray[np.int64], members: Ints, place: Floats, order: NDArray[np.int64],
    x_mm: Floats, slope_x: Floats, kind: int, table: Ints, origin: float, scale: float,
    depth: Floats, triangle: Ints,
) -> None:  # fmt: skip
    """Fill the z-buffer, one block of profiles after another."""
    n, m = depth.shape
    spans = np.empty((_WAITING, 4), dtype=np.int64)
    ends = np.empty((_WAITING, 6))
    waiting = 0
    for block in range(len(start) - 1):
        first, last = block * _BLOCK, min(n, (block + 1) * _BLOCK)
        for row in range(first, last):
            depth[order[row], :] = np.nan
            triangle[order[row], :] = -1
        for member in range(start[block], start[block + 1]):
            t = members[member]
            # Corners from bottom to top; an odd number of exchanges mirrors the triangle.
            i0, i1, i2 = faces[t, 0], faces[t, 1], faces[t, 2]
            mirrored = False
            if y[i0] > y[i1]:
                i0, i1, mirrored = i1, i0, not mirrored
            if y[i1] > y[i2]:
                i1, i2, mirrored = i2, i1, not mirrored
            if y[i0] > y[i1]:
                i0, i1, mirrored = i1, i0, not mirrored
            x0, y0, z0 = x[i0], y[i0], z[i0]
            x1, y1, z1 = x[i1], y[i1], z[i1]
            x2, y2, z2 = x[i2], y[i2], z[i2]
            long_x, long_z = edge_slope(y0, x0, y2, x2), edge_slope(y0, z0, y2, z2)
            lower_x, lower_z = edge_slope(y0, x0, y1, x1), edge_slope(y0, z0, y1, z1)
            upper_x, upper_z = edge_slope(y1, x1, y2, x2), edge_slope(y1, z1, y2, z2)
            for row in range(max(low[t], first), min(high[t], last)):
                px, py, pz = place[row, 0], place[row, 1], place[row, 2]
                ax = x0 + (py - y0) * long_x - px
                az = z0 + (py - y0) * long_z - pz
                if y1 >= py:
                    bx = x0 + (py - y0) * lower_x - px
                    bz = z0 + (py - y0) * lower_z - pz
                else:
                    bx = x1 + (py - y1) * upper_x - px
                    bz = z1 + (py - y1) * upper_z - pz
                if not mirrored:
                    ax, az, bx, bz = bx, bz, ax, az
                there, au, aw, bu, bw = clipped(ax, az, bx, bz)
                if not there:
                    continue
                begin = _left_of(au, aw, x_mm, slope_x, kind, table, origin, scale)
                end = _left_of(bu, bw, x_mm, slope_x, kind, table, origin, scale)
                spans[waiting, 0], spans[waiting, 1] = begin, end
                spans[waiting, 2], spans[waiting, 3] = order[row], t
                ends[waiting, 0], ends[waiting, 1] = ax, az
                ends[waiting, 2], ends[waiting, 3] = bx - ax, bz - az
                ends[waiting, 4], ends[waiting, 5] = min(az, bz), max(az, bz)
                waiting += int(begin < end)
                if waiting == _WAITING:
                    _keep_nearest(depth, triangle, spans, ends, waiting, x_mm, slope_x)
                    waiting = 0
        _keep_nearest(depth, triangle, spans, ends, waiting, x_mm, slope_x)
        waiting = 0


@njit(cache=True, error_model="numpy")
def _keep_nearest(
    depth: Floats, triangle: Ints, spans: NDArray[np.int64], ends: Floats, count: int,
    x_mm: Floats, slope_x: Floats,
) -> None:  # fmt: skip
    """Put the segments' depths where they are nearer than what is there.

    `spans` holds each segment's first point, the one behind its last, its row and its triangle;
    `ends` where it starts (x, z), how far it goes (x, z) and its least and largest z.
    """
    for k in range(count):
        # Unsigned: an index that can't be negative lets the loop be vectorised.
        begin, end = np.uint64(spans[k, 0]), np.uint64(spans[k, 1])
        r, t = np.uint64(spans[k, 2]), np.int32(spans[k, 3])
        x0, z0, dx, dz = ends[k, 0], ends[k, 1], ends[k, 2], ends[k, 3]
        low, high = ends[k, 4], ends[k, 5]
        for j in range(begin, end):
            d = depth_on(x0, z0, dx, dz, low, high, x_mm[j], slope_x[j])
            nearer = (not depth[r, j] <= d) & (d > 0.0)  # also where there is NaN yet
            depth[r, j] = d if nearer else depth[r, j]
            triangle[r, j] = t if nearer else triangle[r, j]
