"""Where a ray meets a triangle: the section by the laser's plane, then the point of the segment.

The one definition of a hit, in double precision, that the sweep and the Embree caster share. In a
frame whose y = 0 plane holds the ray, a triangle is cut in a segment whose ends lie on two of its
edges. Each end is computed from the edge's lower vertex to its upper one, so two triangles that
share an edge get the same end bit by bit; a ray belongs to a segment if it has its two ends on
different sides, an end exactly on the ray counting as left of it. So no ray slips between two
triangles and none meets both.

numba's cache does not detect a change in a function of another file: after an edit of this file,
remove `sensors/__pycache__/*.nb*`.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@njit(cache=True, inline="always")
def turn(frame: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the components of (x, y, z) along the rows of `frame` (3, 3)."""
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


@njit(cache=True, inline="always")
def edge_slopes(
    x0: float, y0: float, z0: float, x1: float, y1: float, z1: float
) -> tuple[float, float]:
    """Return dx/dy, dz/dy along the edge from below to above; 0 for one of negligible height."""
    rise = y1 - y0
    return (
        (x1 - x0) / rise if rise > 1e-200 else 0.0,
        (z1 - z0) / rise if rise > 1e-200 else 0.0,
    )


@njit(cache=True, inline="always")
def edge_point(
    x0: float, y0: float, z0: float, x1: float, y1: float, z1: float, y: float
) -> tuple[float, float]:
    """Return x, z where the edge from below (y0 < y) to above (y1 >= y) crosses the plane y."""
    slope_x, slope_z = edge_slopes(x0, y0, z0, x1, y1, z1)
    return x0 + (y - y0) * slope_x, z0 + (y - y0) * slope_z


@njit(cache=True, inline="always")
def segment(
    ax: float, ay: float, az: float,
    bx: float, by: float, bz: float,
    cx: float, cy: float, cz: float,
    y: float,
) -> tuple[bool, float, float, float, float]:  # fmt: skip
    """Cut the triangle a, b, c by the plane y; return (cut at all, x, z, x, z of the ends).

    Where a ray meets the triangle from outside, the first end is left of it.
    """
    up_a = ay >= y
    up_b = by >= y
    up_c = cy >= y
    if up_a == up_b and up_b == up_c:
        return False, 0.0, 0.0, 0.0, 0.0
    # Turn the triangle so that a is alone on its side.
    if up_a == up_c:
        ax, ay, az, bx, by, bz, cx, cy, cz = bx, by, bz, cx, cy, cz, ax, ay, az
        up_a = up_b
    elif up_a == up_b:
        ax, ay, az, bx, by, bz, cx, cy, cz = cx, cy, cz, ax, ay, az, bx, by, bz
        up_a = up_c
    # Now a-b and a-c are the edges cut; seen from outside, c's end is left where a is above.
    if up_a:
        lx, ly, lz, mx, my, mz = cx, cy, cz, bx, by, bz  # the lower ends
        bx, by, bz, cx, cy, cz = ax, ay, az, ax, ay, az  # the upper ones
    else:
        lx, ly, lz, mx, my, mz = ax, ay, az, ax, ay, az
    x0, z0 = edge_point(lx, ly, lz, bx, by, bz, y)
    x1, z1 = edge_point(mx, my, mz, cx, cy, cz, y)
    return True, x0, z0, x1, z1


@njit(cache=True, inline="always")
def clipped(
    x0: float, z0: float, x1: float, z1: float
) -> tuple[bool, float, float, float, float]:
    """Keep the part of a segment with z >= 0 (before the emitter); False for an empty rest."""
    if z0 < 0.0:
        if z1 < 0.0:
            return False, x0, z0, x1, z1
        return True, x0 + (x1 - x0) * (z0 / (z0 - z1)), 0.0, x1, z1
    if z1 < 0.0:
        return True, x0, z0, x1 + (x0 - x1) * (z1 / (z1 - z0)), 0.0
    return True, x0, z0, x1, z1


@njit(cache=True, inline="always", error_model="numpy")
def depth_on(
    x0: float, z0: float, dx: float, dz: float, low: float, high: float, x: float, slope: float
) -> float:
    """Depth at which the ray x + slope·z meets the segment from (x0, z0) on by (dx, dz).

    (x0, z0) is the end left of the ray; the depth is held to [low, high], the ends' own.
    """
    depth = z0 + dz * ((x + slope * z0 - x0) / (dx - slope * dz))
    depth = depth if depth > low else low  # also where 0 / 0
    return depth if depth < high else high


@njit(cache=True, error_model="numpy")
def ray_depth(
    vertices: Floats, faces: Ints, triangle: int,
    frame: Floats, origin: Floats, place: Floats, x: float, slope: float, outside: bool,
) -> float:  # fmt: skip
    """Depth at which one ray meets one triangle; infinite where it doesn't.

    Parameters
    ----------
    vertices, faces, triangle
        The mesh (part frame, mm) and the triangle's number.
    frame, origin, place
        A vertex v has the frame's coordinates frame @ (v - origin) - place.
    x, slope
        The ray, (x, 0, 0) + depth·(slope, 0, 1) in that frame.
    outside
        Count only hits on the triangle's outer side.
    """
    i, j, k = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    ax, ay, az = turn(
        frame,
        vertices[i, 0] - origin[0], vertices[i, 1] - origin[1], vertices[i, 2] - origin[2],
    )  # fmt: skip
    bx, by, bz = turn(
        frame,
        vertices[j, 0] - origin[0], vertices[j, 1] - origin[1], vertices[j, 2] - origin[2],
    )  # fmt: skip
    cx, cy, cz = turn(
        frame,
        vertices[k, 0] - origin[0], vertices[k, 1] - origin[1], vertices[k, 2] - origin[2],
    )  # fmt: skip
    cut, x0, z0, x1, z1 = segment(ax, ay, az, bx, by, bz, cx, cy, cz, place[1])
    if not cut:
        return math.inf
    x0, x1 = x0 - place[0], x1 - place[0]
    z0, z1 = z0 - place[2], z1 - place[2]
    there, u0, w0, u1, w1 = clipped(x0, z0, x1, z1)
    if not there:
        return math.inf
    left0 = not x + slope * w0 < u0
    left1 = not x + slope * w1 < u1
    if left0 == left1 or (outside and left1):
        return math.inf
    if left1:
        x0, z0, x1, z1 = x1, z1, x0, z0
    depth = depth_on(x0, z0, x1 - x0, z1 - z0, min(z0, z1), max(z0, z1), x, slope)
    return depth if depth > 0.0 else math.inf


@njit(cache=True)
def passes_near(
    vertices: Floats, faces: Ints, triangle: int,
    frame: Floats, origin: Floats, place: Floats, x: float, slope: float, margin_mm: float,
) -> bool:  # fmt: skip
    """Whether a ray passes the box around a triangle, seen along it, at no more than a margin.

    The parameters are those of `ray_depth`.
    """
    left, right, low, high = math.inf, -math.inf, math.inf, -math.inf
    for corner in range(3):
        i = faces[triangle, corner]
        vx, vy, vz = turn(
            frame,
            vertices[i, 0] - origin[0], vertices[i, 1] - origin[1], vertices[i, 2] - origin[2],
        )  # fmt: skip
        across = vx - place[0] - (x + slope * (vz - place[2]))
        along = vy - place[1]
        left, right = min(left, across), max(right, across)
        low, high = min(low, along), max(high, along)
    return left <= margin_mm and right >= -margin_mm and low <= margin_mm and high >= -margin_mm
