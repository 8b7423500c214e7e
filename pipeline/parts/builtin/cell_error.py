"""How far the two triangles of a cell lie from its sheet: the measures of `adaptive_sheet`.

Sums are made in a fixed order: a cell that bends as much along a as along b is halved the same
way on each machine.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def measure(cloud: Floats, error: Floats, bend: Floats, length: Floats) -> None:
    """Measure one face of each cell; take its figures into those of the other face.

    Parameters
    ----------
    cloud
        (C, S, S, 3) points of the face on a grid over each cell, mm.
    error
        (C,) distance of the cell's triangles from the points along the normals there, mm; raised.
    bend
        (2, C) distance of the points from the chords along a and along b, mm; raised.
    length
        (2, C) greatest length of the rows of points along a and along b, mm; overwritten.
    """
    p = np.ascontiguousarray(cloud.transpose(3, 1, 2, 0))  # cells last: long inner loops
    share = np.linspace(0.0, 1.0, p.shape[1])
    s, t = share[:, None, None], share[:, None]
    normal = _normals(_slopes(p), _slopes(p.swapaxes(1, 2)).swapaxes(1, 2))
    level = _on_triangles(p, all_rise(*(cloud[:, i, j] for i, j in CORNERS)), s, t)
    along_a = p[:, :1] + s * (p[:, -1:] - p[:, :1])
    along_b = p[:, :, :1] + t * (p[:, :, -1:] - p[:, :, :1])
    for surface, worst in ((level, error), (along_a, bend[0]), (along_b, bend[1])):
        gap = (p[0] - surface[0]) * normal[0]
        gap += (p[2] - surface[2]) * normal[2]
        gap += (p[1] - surface[1]) * normal[1]
        np.fmax(worst, np.abs(gap).max(axis=(0, 1)), out=worst)
    length[0] = _length(p).max(axis=0)
    length[1] = _length(p.swapaxes(1, 2)).max(axis=0)


CORNERS = ((0, 0), (-1, 0), (0, -1), (-1, -1))
"""Places of a cell's corners p00, p10, p01, p11 in its grid of points."""


def all_rise(p00: Floats, p10: Floats, p01: Floats, p11: Floats) -> Bools:
    """Whether the diagonal from p00 to p11 gives the better worst triangle; corners (C, 3)."""
    rising = np.minimum(_quality(p00, p10, p11), _quality(p00, p11, p01))
    falling = np.minimum(_quality(p00, p10, p01), _quality(p10, p11, p01))
    return np.asarray(rising >= falling * (1.0 - 1e-6))


def _quality(p: Floats, q: Floats, r: Floats) -> Floats:
    """Return twice the area over the square of the longest edge; corners (C, 3)."""
    a0, a1, a2 = (q - p).T
    b0, b1, b2 = (r - p).T
    c0, c1, c2 = (r - q).T
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    longest = np.maximum(a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2)
    longest = np.maximum(longest, c0 * c0 + c1 * c1 + c2 * c2)
    with np.errstate(invalid="ignore"):  # a triangle of no size
        return np.asarray(np.sqrt(n0 * n0 + n1 * n1 + n2 * n2) / longest)


def _slopes(p: Floats) -> Floats:
    """Return the slopes of rows of points (3, S, ...) along their second axis, for one step."""
    slopes = np.empty_like(p)
    slopes[:, 1:-1] = (p[:, 2:] - p[:, :-2]) / 2.0
    slopes[:, 0] = p[:, 1] - p[:, 0]
    slopes[:, -1] = p[:, -1] - p[:, -2]
    return slopes


def _normals(u: Floats, v: Floats) -> Floats:
    """Return the unit vectors across u and v, all (3, ...); 0 where they are parallel."""
    out = np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                    u[0] * v[1] - u[1] * v[0]])  # fmt: skip
    size = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    unit: Floats = np.divide(out, size, out=np.zeros_like(out), where=size > 0.0)
    return unit


def _on_triangles(p: Floats, short: Bools, s: Floats, t: Floats) -> Floats:
    """Interpolate points (3, S, S, C) in the cells' triangles, split as `all_rise` says."""
    p00, p10, p01, p11 = (p[:, i, j][:, None, None] for i, j in CORNERS)
    rising = np.where(
        s >= t,
        p00 + s * (p10 - p00) + t * (p11 - p10),
        p00 + t * (p01 - p00) + s * (p11 - p01),
    )
    falling = np.where(
        s + t <= 1.0,
        p00 + s * (p10 - p00) + t * (p01 - p00),
        p11 + (1.0 - s) * (p01 - p11) + (1.0 - t) * (p10 - p11),
    )
    return np.where(short, rising, falling)


def _length(p: Floats) -> Floats:
    """Return the lengths of the lines through points (3, S, ...) along their second axis."""
    total = np.zeros(p.shape[2:])
    for i in range(p.shape[1] - 1):
        d0, d1, d2 = p[:, i + 1] - p[:, i]
        total += np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    return total
