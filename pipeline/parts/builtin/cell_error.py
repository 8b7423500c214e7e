"""How far the two triangles of a cell lie from its sheet: the compiled part of `adaptive_sheet`.

Sums are made in a fixed order: a cell that bends as much along a as along b is halved the same
way on each machine.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@njit(cache=True, error_model="numpy")
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
    count = cloud.shape[1]
    share = np.linspace(0.0, 1.0, count)
    u, v, n = np.empty(3), np.empty(3), np.empty(3)
    for c in range(len(cloud)):
        cell = cloud[c]
        short = rises(cell[0, 0], cell[-1, 0], cell[0, -1], cell[-1, -1])
        for i in range(count):
            for j in range(count):
                for k in range(3):
                    u[k] = _slope(cell[:, j, k], i)
                    v[k] = _slope(cell[i, :, k], j)
                _normal(u, v, n)
                s, t = share[i], share[j]
                gap = along_a = along_b = 0.0
                for k in (0, 2, 1):
                    p = cell[i, j, k]
                    gap += (p - _on_triangles(cell[:, :, k], short, s, t)) * n[k]
                    first, last = cell[0, j, k], cell[-1, j, k]
                    along_a += (p - (first + s * (last - first))) * n[k]
                    first, last = cell[i, 0, k], cell[i, -1, k]
                    along_b += (p - (first + t * (last - first))) * n[k]
                error[c] = max(error[c], abs(gap))
                bend[0, c] = max(bend[0, c], abs(along_a))
                bend[1, c] = max(bend[1, c], abs(along_b))
        length[0, c] = length[1, c] = 0.0
        for i in range(count):
            length[0, c] = max(length[0, c], _length(cell[:, i]))
            length[1, c] = max(length[1, c], _length(cell[i]))


@njit(cache=True, error_model="numpy")
def all_rise(p00: Floats, p10: Floats, p01: Floats, p11: Floats) -> Bools:
    """Say `rises` of many cells, corners (C, 3)."""
    out = np.empty(len(p00), np.bool_)
    for c in range(len(p00)):
        out[c] = rises(p00[c], p10[c], p01[c], p11[c])
    return out


@njit(cache=True, error_model="numpy")
def rises(p00: Floats, p10: Floats, p01: Floats, p11: Floats) -> bool:
    """Whether the diagonal from p00 to p11 gives the better worst triangle; corners (3,)."""
    rising = min(_quality(p00, p10, p11), _quality(p00, p11, p01))
    falling = min(_quality(p00, p10, p01), _quality(p10, p11, p01))
    return rising >= falling * (1.0 - 1e-6)


@njit(cache=True, error_model="numpy")
def _quality(p: Floats, q: Floats, r: Floats) -> float:
    """Return twice the area over the square of the longest edge."""
    a0, a1, a2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    b0, b1, b2 = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    c0, c1, c2 = r[0] - q[0], r[1] - q[1], r[2] - q[2]
    longest: float = max(
        a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2, c0 * c0 + c1 * c1 + c2 * c2
    )
    area: float = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    return area / longest


@njit(cache=True)
def _slope(row: Floats, i: int) -> float:
    """Return the slope at point i of a row (S,), for one step."""
    slope: float = row[min(i + 1, len(row) - 1)] - row[max(i - 1, 0)]
    return slope / 2.0 if 0 < i < len(row) - 1 else slope


@njit(cache=True)
def _normal(u: Floats, v: Floats, out: Floats) -> None:
    """Put into `out` the unit vector across u and v, all (3,); 0 where they are parallel."""
    out[0] = u[1] * v[2] - u[2] * v[1]
    out[1] = u[2] * v[0] - u[0] * v[2]
    out[2] = u[0] * v[1] - u[1] * v[0]
    size = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    for k in range(3):
        out[k] = out[k] / size if size > 0.0 else 0.0


@njit(cache=True)
def _on_triangles(z: Floats, short: bool, s: float, t: float) -> float:
    """Interpolate one coordinate (S, S) in the cell's triangles, split as `rises` says."""
    z00, z10, z01, z11 = z[0, 0], z[-1, 0], z[0, -1], z[-1, -1]
    level: float
    if short and s >= t:
        level = z00 + s * (z10 - z00) + t * (z11 - z10)
    elif short:
        level = z00 + t * (z01 - z00) + s * (z11 - z01)
    elif s + t <= 1.0:
        level = z00 + s * (z10 - z00) + t * (z01 - z00)
    else:
        level = z11 + (1.0 - s) * (z01 - z11) + (1.0 - t) * (z10 - z11)
    return level


@njit(cache=True)
def _length(row: Floats) -> float:
    """Return the length of the line through a row of points (S, 3)."""
    total = 0.0
    for i in range(len(row) - 1):
        d0 = row[i + 1, 0] - row[i, 0]
        d1 = row[i + 1, 1] - row[i, 1]
        d2 = row[i + 1, 2] - row[i, 2]
        total += np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    return total
