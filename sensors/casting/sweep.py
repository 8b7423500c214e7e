"""The sweep: a straight scan of constant orientation, cast without a search.

Along such a leg every profile is the section of the part by a plane. Each triangle covers a run of
profiles, in each of them it is a segment, and the segment covers a run of points: a z-buffer over
(profile, point) collects the nearest. `sensors.casting.section` defines hits and their depths, so
the sweep and the Embree caster agree to the last bit.
"""

import math
from typing import NamedTuple, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.casting.section import Floats, Ints, clipped, depth_on, edge_slopes

_WAITING = 256  # segments found before their points are computed
_BLOCK = 16  # profiles whose part of the z-buffer stays in the processor's cache


class Corners(NamedTuple):
    """A mesh in a leg's axes: coordinates of its vertices (V,), and its faces (F, 3)."""

    x: Floats
    y: Floats
    z: Floats
    faces: Ints


class Runs(NamedTuple):
    """Runs of profiles that each triangle covers, and the runs of each block of profiles.

    Attributes
    ----------
    which, low, high : (k,)
        Triangle, its first profile, the one behind its last.
    start, members
        `members[start[b]:start[b + 1]]` are the runs of block b.
    """

    which: Ints
    low: Ints
    high: Ints
    start: NDArray[np.int64]
    members: Ints


class Fan(NamedTuple):
    """Rays of a profile, and how to find the first one right of a point.

    Attributes
    ----------
    x_mm, slope_x : (m,)
    kind : int
        Property that orders the rays: 0 slope, 1 position, 2 both.
    table, origin, scale
        See `_lookup`.
    """

    x_mm: Floats
    slope_x: Floats
    kind: int
    table: Ints
    origin: float
    scale: float


class Buffers(NamedTuple):
    """Buffers of segments that are stored many at a time.

    Attributes
    ----------
    source, spans : (2, k)
        Row and triangle; first point and the one behind the last.
    ends, clip : (4, k)
        x, z of both ends; the same of what lies before the emitter.
    """

    source: NDArray[np.int64]
    ends: Floats
    clip: Floats
    spans: NDArray[np.int64]

    @classmethod
    def empty(cls) -> Self:
        """Return buffers of `_WAITING` segments."""
        whole = [np.empty((2, _WAITING), dtype=np.int64) for _ in range(2)]
        return cls(whole[0], np.empty((4, _WAITING)), np.empty((4, _WAITING)), whole[1])


def sweepable(x_mm: Floats, slope_x: Floats) -> bool:
    """Whether no two rays of the profile cross before the emitter, so that their order is fixed."""
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
    which, low, high = _runs(
        x, y, z, faces, slope_x[0], slope_x[-1],
        sorted_place[:, 1].copy(), rows, row_origin, row_scale,
    )  # fmt: skip
    start, members = _blocks(low, high, n)
    # Rays sorted by the one number that tells them apart: their slope, or their place.
    kind, table, origin, scale = 2, np.zeros(2, dtype=np.int32), 0.0, 0.0
    if m < 3:
        pass
    elif x_mm[0] == x_mm[-1]:
        kind, (table, origin, scale) = 0, _lookup(slope_x)
    elif slope_x[0] == slope_x[-1]:
        kind, (table, origin, scale) = 1, _lookup(x_mm)
    depth = np.empty((n, m))
    triangle = np.empty((n, m), dtype=np.int32)
    _fill(
        Corners(x, y, z, faces), Runs(which, low, high, start, members), sorted_place, order,
        Fan(x_mm, slope_x, kind, table, origin, scale), Buffers.empty(), depth, triangle,
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


@njit(cache=True, inline="always")
def _not_above(values: Floats, table: Ints, origin: float, scale: float, value: float) -> int:
    """How many of the sorted `values` aren't above a value."""
    n = len(values)
    i = min(_guess(table, origin, scale, value), n - 1)
    i += int(values[np.uint64(i)] <= value)  # without a branch, this settles nearly all
    while i > 0 and values[i - 1] > value:
        i -= 1
    while i < n and values[i] <= value:
        i += 1
    return i


@njit(cache=True)
def _runs(
    x: Floats, y: Floats, z: Floats, faces: Ints, slope_low: float, slope_high: float,
    profile_y: Floats, table: Ints, origin: float, scale: float,
) -> tuple[Ints, Ints, Ints]:  # fmt: skip
    """Triangles that cover profiles; the first of these, and the one behind the last.

    A triangle covers ymin < y <= ymax; one that shows all rays its inner side covers none.
    """
    count, kept = len(faces), 0
    which = np.empty(count, dtype=np.int32)
    span = np.empty((2, count), dtype=np.int32)
    first_y, last_y = profile_y[0], profile_y[-1]
    for t in range(count):
        i0, i1, i2 = faces[t, 0], faces[t, 1], faces[t, 2]
        a, b, c = y[i0], y[i1], y[i2]
        if max(a, b, c) < first_y or min(a, b, c) >= last_y:
            continue  # beside all profiles
        left, right = (b - a) * (z[i2] - z[i0]), (z[i1] - z[i0]) * (c - a)
        normal_x, size_x = left - right, abs(left) + abs(right)
        left, right = (x[i1] - x[i0]) * (c - a), (b - a) * (x[i2] - x[i0])
        normal_z, size_z = left - right, abs(left) + abs(right)
        away = min(normal_x * slope_low, normal_x * slope_high) + normal_z
        if away > 1e-9 * (size_x + size_z):
            continue
        which[kept] = t
        for end in range(2):
            value = max(a, b, c) if end else min(a, b, c)
            span[end, kept] = _not_above(profile_y, table, origin, scale, value)
        kept += int(span[0, kept] < span[1, kept])
    return which[:kept], span[0, :kept], span[1, :kept]


@njit(cache=True)
def _blocks(low: Ints, high: Ints, n: int) -> tuple[NDArray[np.int64], Ints]:
    """List the runs that each block of profiles meets, ascending; and where each list starts."""
    blocks = (n + _BLOCK - 1) // _BLOCK
    start = np.zeros(blocks + 1, dtype=np.int64)
    for k in range(len(low)):
        for b in range(low[k] // _BLOCK, (high[k] - 1) // _BLOCK + 1):
            start[b + 1] += 1
    for b in range(blocks):
        start[b + 1] += start[b]
    at = np.zeros(blocks + 1, dtype=np.int64)
    for b in range(blocks):
        at[b] = start[b]
    members = np.empty(start[blocks], dtype=np.int32)
    for k in range(len(low)):
        for b in range(low[k] // _BLOCK, (high[k] - 1) // _BLOCK + 1):
            members[at[b]] = k
            at[b] += 1
    return start, members


@njit(cache=True, error_model="numpy")
def _left_of(
    x: Floats, z: Floats, count: int, fan: Fan, found: NDArray[np.int64]
) -> None:
    """Find how many rays pass left of each (x, z), z >= 0: x_mm + slope_x·z < x.

    Many at once, in passes without branches, whose outcome is unpredictable here.
    """
    x_mm, slope_x, kind, table, origin, scale = fan
    m = len(x_mm)
    if kind == 2:
        for k in range(count):
            j, top = 0, m
            while j < top:
                middle = (j + top) // 2
                if x_mm[middle] + slope_x[middle] * z[k] < x[k]:
                    j = middle + 1
                else:
                    top = middle
            found[k] = j
        return
    last = len(table) - 1
    for k in range(count):
        value = (x[k] - x_mm[0]) / z[k] if kind == 0 else x[k] - slope_x[0] * z[k]
        cell = (value - origin) * scale
        cell = cell if cell > 0.0 else 0.0  # NaN too
        cell = cell if cell < last else float(last)
        found[k] = min(max(int(table[np.uint64(cell)]), 1), m - 2)
    # A ray and its two neighbours settle nearly all; the loops make sure.
    unsettled = 0
    for k in range(count):
        ray = np.uint64(found[k])
        left, right = ray - np.uint64(1), ray + np.uint64(1)
        before = int(x_mm[left] + slope_x[left] * z[k] < x[k])
        after = int(x_mm[right] + slope_x[right] * z[k] < x[k])
        found[k] += before + int(x_mm[ray] + slope_x[ray] * z[k] < x[k]) + after - 1
        unsettled += 1 - before + after
    if unsettled == 0:
        return
    for k in range(count):
        j = found[k]
        while j > 0 and not x_mm[j - 1] + slope_x[j - 1] * z[k] < x[k]:
            j -= 1
        while j < m and x_mm[j] + slope_x[j] * z[k] < x[k]:
            j += 1
        found[k] = j


@njit(cache=True, inline="always")
def _risen(
    i: int, j: int, low: float, high: float
) -> tuple[int, int, float, float, bool]:
    """Exchange two corners, and their heights, where the first is above; and whether it was."""
    turned = low > high
    return (
        j if turned else i, i if turned else j,
        high if turned else low, low if turned else high, turned,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    corners: Corners, runs: Runs, place: Floats, order: NDArray[np.int64], fan: Fan,
    buffers: Buffers, depth: Floats, triangle: Ints,
) -> None:  # fmt: skip
    """Fill the z-buffer, one block of profiles after another."""
    x, y, z, faces = corners
    which, low, high, start, members = runs
    n = len(depth)
    source, ends, clip, _ = buffers
    for block in range(len(start) - 1):
        first, last = block * _BLOCK, min(n, (block + 1) * _BLOCK)
        for row in range(first, last):
            r = np.uint64(order[row])
            for j in range(depth.shape[1]):  # a slice's assignment takes long to compile
                depth[r, j], triangle[r, j] = np.nan, -1
        waiting = int(np.int64(0))  # no literal: one type, compiled once
        for member in range(start[block], start[block + 1]):
            run = members[member]
            t = which[run]
            # Corners from bottom to top; an odd number of exchanges mirrors the triangle.
            i0, i1, i2 = faces[t, 0], faces[t, 1], faces[t, 2]
            y0, y1, y2 = y[i0], y[i1], y[i2]
            i0, i1, y0, y1, once = _risen(i0, i1, y0, y1)
            i1, i2, y1, y2, twice = _risen(i1, i2, y1, y2)
            i0, i1, y0, y1, thrice = _risen(i0, i1, y0, y1)
            mirrored = once ^ twice ^ thrice
            x0, x1, x2, z0, z1, z2 = x[i0], x[i1], x[i2], z[i0], z[i1], z[i2]
            long_x, long_z = edge_slopes(x0, y0, z0, x2, y2, z2)
            lower_x, lower_z = edge_slopes(x0, y0, z0, x1, y1, z1)
            upper_x, upper_z = edge_slopes(x1, y1, z1, x2, y2, z2)
            for row in range(max(low[run], first), min(high[run], last)):
                px, py, pz = place[row, 0], place[row, 1], place[row, 2]
                ax = x0 + (py - y0) * long_x - px
                az = z0 + (py - y0) * long_z - pz
                upper = y1 < py
                rise = py - (y1 if upper else y0)
                bx = (x1 if upper else x0) + rise * (upper_x if upper else lower_x) - px
                bz = (z1 if upper else z0) + rise * (upper_z if upper else lower_z) - pz
                lx, rx = (ax, bx) if mirrored else (bx, ax)
                lz, rz = (az, bz) if mirrored else (bz, az)
                there, au, aw, bu, bw = clipped(lx, lz, rx, rz)
                source[0, waiting], source[1, waiting] = order[row], t
                ends[0, waiting], ends[1, waiting] = lx, lz
                ends[2, waiting], ends[3, waiting] = rx, rz
                clip[0, waiting], clip[1, waiting] = au, aw
                clip[2, waiting], clip[3, waiting] = bu, bw
                waiting += int(there)
                if waiting == _WAITING:
                    _store(buffers, waiting, fan, depth, triangle)
                    waiting = int(np.int64(0))  # no literal: one type, compiled once
        _store(buffers, waiting, fan, depth, triangle)


@njit(cache=True, error_model="numpy")
def _store(buffers: Buffers, count: int, fan: Fan, depth: Floats, triangle: Ints) -> None:
    """Store the depths of `count` segments where they are nearer than the stored ones."""
    source, ends, clip, spans = buffers
    x_mm, slope_x = fan.x_mm, fan.slope_x
    for side in range(2):
        _left_of(clip[2 * side], clip[2 * side + 1], count, fan, spans[side])
    for k in range(count):
        if spans[0, k] >= spans[1, k]:
            continue
        # Unsigned: an index that can't be negative lets the loop be vectorised.
        begin, end = np.uint64(spans[0, k]), np.uint64(spans[1, k])
        r, t = np.uint64(source[0, k]), np.int32(source[1, k])
        x0, z0, z1 = ends[0, k], ends[1, k], ends[3, k]
        dx, dz, low, high = ends[2, k] - x0, z1 - z0, min(z0, z1), max(z0, z1)
        for j in range(begin, end):
            d = depth_on(x0, z0, dx, dz, low, high, x_mm[j], slope_x[j])
            nearer = (not depth[r, j] <= d) & (d > 0.0)  # also where there is NaN yet
            depth[r, j] = d if nearer else depth[r, j]
            triangle[r, j] = t if nearer else triangle[r, j]
