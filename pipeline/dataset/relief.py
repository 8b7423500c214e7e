"""Local relief: the reading minus form and waviness by a Gaussian filter."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Band = tuple[slice, slice, Floats]
Neighbours = tuple[NDArray[np.intp], NDArray[np.intp], Floats]

CUTOFF_MM: Final = 8.0  # of the series of ISO 21920-3: a flaw 8 mm wide keeps half its height
ALPHA: Final = math.sqrt(math.log(2) / math.pi)  # ISO 16610-21: transmission 50 % at the cutoff
BLOCKS: Final = 4  # in a standard deviation of the window
TRUNCATED: Final = 3.0  # standard deviations at which the window ends
LEAST_ROWS: Final = 16  # blocks of a band
RANK_SHARE: Final = 1e-6  # below, in units of the window, too few readings for a plane


def pitch_mm(scan: Mapping[str, Any]) -> tuple[float, float]:
    """Return the distance between profiles and between points at the scan's median depth, mm.

    Parameters
    ----------
    scan
        Arrays `depth` (mm, NaN = missing), `pose`, `ray_x_mm`, `ray_slope`.
    """
    depth = np.asarray(scan["depth"], dtype=np.float64)
    typical = float(np.nanmedian(depth)) if np.isfinite(depth).any() else 0.0
    x = np.sort(scan["ray_x_mm"] + typical * scan["ray_slope"])
    steps = np.linalg.norm(np.diff(scan["pose"][:, :3, 3], axis=0), axis=1)
    return float(np.median(steps)), float(np.median(np.diff(x)))


def local_relief(
    depth_mm: Floats, pitch_yx_mm: tuple[float, float], cutoff_mm: float = CUTOFF_MM
) -> Floats:
    """Return the height above the waviness, mm, positive towards the sensor; NaN = missing.

    The waviness is a Gaussian regression filter of order 1 (ISO 16610-21 for the weights,
    ISO 16610-28 for the regression): in each window a plane is fitted with Gaussian weights, so
    that a tilted part has no relief, at borders and beside missing readings neither.

    Parameters
    ----------
    depth_mm : (n, m) float64
        Depths, NaN = missing.
    pitch_yx_mm
        Distance between profiles and between points, mm.
    cutoff_mm
        Wavelength that passes by half, mm.
    """
    valid = np.isfinite(depth_mm)
    if not valid.any():
        return np.full(depth_mm.shape, np.nan)
    sigma = [
        min(ALPHA * cutoff_mm / math.sqrt(2 * math.pi) / max(pitch, 1e-9), float(count))
        for pitch, count in zip(pitch_yx_mm, depth_mm.shape, strict=True)
    ]
    typical = float(np.median(depth_mm[valid]))
    # in units of the window's width, from the scan's middle: well conditioned
    y, x = (
        (np.arange(count, dtype=np.float64) - count / 2) / width
        for count, width in zip(depth_mm.shape, sigma, strict=True)
    )
    rows, points = (
        _Blocks(count, width) for count, width in zip(depth_mm.shape, sigma, strict=True)
    )
    moments = np.zeros((rows.number, 9, points.number))
    _add_moments(depth_mm, typical, y, x, rows.size, points.size, moments)
    planes = _planes(rows.means(points.means(moments, 2), 0))
    relief: Floats = _above(depth_mm, typical, y, x, rows.neighbours, points.neighbours, planes)
    return relief


@njit(cache=True)
def _add_moments(
    depth_mm: Floats, typical_mm: float, y: Floats, x: Floats, rows: int, points: int, out: Floats
) -> None:
    """Add up the moments of each block's readings: of 1, y, x, h, y², x², xy, hy, hx.

    Parameters
    ----------
    depth_mm : (n, m)
        Depths, NaN = missing.
    typical_mm
        Depth of height h = 0.
    y, x : (n,), (m,)
        Places of profiles and points.
    rows, points
        Size of a block.
    out : (N, 9, M)
        The moments.
    """
    n, m = depth_mm.shape
    for i in range(n):
        moments = out[i // rows]
        for block in range(moments.shape[1]):
            held = at = square = height = tilt = 0.0
            for j in range(block * points, min((block + 1) * points, m)):
                h = typical_mm - depth_mm[i, j]
                if np.isfinite(h):
                    held += 1.0
                    at += x[j]
                    square += x[j] * x[j]
                    height += h
                    tilt += h * x[j]
            moments[0, block] += held
            moments[1, block] += held * y[i]
            moments[2, block] += at
            moments[3, block] += height
            moments[4, block] += held * y[i] * y[i]
            moments[5, block] += square
            moments[6, block] += at * y[i]
            moments[7, block] += height * y[i]
            moments[8, block] += tilt


@njit(cache=True)
def _planes(moments: Floats) -> Floats:
    """Return the planes (3, N, M) of weighted moments (N, 9, M).

    Each is its height at y = x = 0, and its slopes along y and x.
    """
    planes = np.zeros((3, moments.shape[0], moments.shape[2]))
    for i in range(planes.shape[1]):
        for j in range(planes.shape[2]):
            held = max(moments[i, 0, j], 1e-300)
            my, mx, hm = moments[i, 1, j] / held, moments[i, 2, j] / held, moments[i, 3, j] / held
            yy = moments[i, 4, j] / held - my * my
            xx = moments[i, 5, j] / held - mx * mx
            xy = moments[i, 6, j] / held - mx * my
            hy = moments[i, 7, j] / held - my * hm
            hx = moments[i, 8, j] / held - mx * hm
            determinant = yy * xx - xy * xy
            if determinant >= RANK_SHARE:
                planes[1, i, j] = (hy * xx - hx * xy) / determinant
                planes[2, i, j] = (hx * yy - hy * xy) / determinant
            planes[0, i, j] = hm - planes[1, i, j] * my - planes[2, i, j] * mx
    return planes


@njit(cache=True)
def _above(
    depth_mm: Floats, typical_mm: float, y: Floats, x: Floats, rows: Neighbours,
    points: Neighbours, planes: Floats,
) -> Floats:  # fmt: skip
    """Return the heights (n, m) above the blocks' planes, blended linearly between blocks."""
    relief = np.empty(depth_mm.shape)
    for i in range(len(y)):
        low, high, share = rows[0][i], rows[1][i], rows[2][i]
        plane = planes[:, low] * (1.0 - share) + planes[:, high] * share
        level, slope = plane[0] + plane[1] * y[i], plane[2]
        for j in range(len(x)):
            low, high, share = points[0][j], points[1][j], points[2][j]
            at = level[low] * (1.0 - share) + level[high] * share
            at += (slope[low] * (1.0 - share) + slope[high] * share) * x[j]
            relief[i, j] = typical_mm - depth_mm[i, j] - at
    return relief


class _Blocks:
    """Blocks of an axis's readings, a quarter of the window's width wide, and means of them.

    Planes are fitted around blocks and blended linearly between them. Readings on a plane give
    that plane everywhere, and so the plane itself.

    Parameters
    ----------
    count
        Readings along the axis.
    sigma
        Standard deviation of the window, in readings.
    """

    def __init__(self, count: int, sigma: float) -> None:
        self.size = max(1, int(sigma / BLOCKS))
        self.number = -(-count // self.size)
        self._bands = _bands(self.number, sigma / self.size)
        at = np.clip((np.arange(count) + 0.5) / self.size - 0.5, 0, self.number - 1)
        low = np.minimum(at.astype(np.intp), max(self.number - 2, 0))
        self.neighbours: Neighbours = low, np.minimum(low + 1, self.number - 1), at - low

    def means(self, sums: Floats, axis: int) -> Floats:
        """Return Gaussian means of blocks' sums along the first or last axis, up to a factor."""
        found = np.empty_like(sums)
        if axis == 0:
            flat, out = sums.reshape(len(sums), -1), found.reshape(len(sums), -1)
            for near, rows, band in self._bands:
                np.matmul(band, flat[near], out=out[rows])
        else:
            flat, out = sums.reshape(-1, self.number), found.reshape(-1, self.number)
            for near, rows, band in self._bands:
                np.matmul(flat[:, near], band.T, out=out[:, rows])
        return found


def _bands(number: int, sigma: float) -> list[Band]:
    """Return the matrix of Gaussian means over blocks, band by band.

    Each band has the blocks that it needs, its rows, and these rows' elements: products of small
    full matrices take a quarter of a filter's time.
    """
    radius = int(TRUNCATED * sigma + 0.5)
    rows = max(LEAST_ROWS, 2 * radius)
    found = []
    for first in range(0, number, rows):
        last = min(first + rows, number)
        near = slice(max(0, first - radius), min(number, last + radius))
        lag = np.arange(near.start, near.stop) - np.arange(first, last)[:, None]
        weight = np.exp(-0.5 * np.square(lag / sigma))
        found.append((near, slice(first, last), np.where(np.abs(lag) <= radius, weight, 0.0)))
    return found
