"""What a sensor's firmware does to readings: gaps filled, median and mean over a window.

Missing readings (NaN) take no part in a window and stay missing; windows are cut at the border.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROOT_HALF = math.sqrt(0.5)
PEAK = 1.0 / math.sqrt(2.0 * math.pi)
FLAT = 0.2
"""Range of a window's means, over the noise, within which they are taken as equal."""


@njit(cache=True)
def gaps_filled(depth_mm: Floats, most: int) -> Floats:
    """Fill gaps of up to `most` points along the line with the straight line between its ends.

    Gaps at a profile's ends stay.
    """
    out = depth_mm.copy()
    n, m = depth_mm.shape
    for i in range(n):
        last = -1
        for j in range(m):
            if np.isnan(depth_mm[i, j]):
                continue
            gap = j - last - 1
            if last >= 0 and 0 < gap <= most:
                step = (depth_mm[i, j] - depth_mm[i, last]) / (gap + 1)
                for k in range(1, gap + 1):
                    out[i, last + k] = depth_mm[i, last] + k * step
            last = j
    return out


@njit(cache=True)
def windowed_median(depth_mm: Floats, profiles: int, points: int) -> Floats:
    """Median of the readings in a window about each reading, (n, m)."""
    n, m = depth_mm.shape
    out = np.full((n, m), np.nan)
    window = np.empty(profiles * points)
    half_i, half_j = profiles // 2, points // 2
    for i in range(n):
        for j in range(m):
            if np.isnan(depth_mm[i, j]):
                continue
            count = _gather(depth_mm, i, j, half_i, half_j, window)
            out[i, j] = np.median(window[:count])
    return out


@njit(cache=True)
def _gather(
    depth_mm: Floats, i: int, j: int, half_i: int, half_j: int, values: Floats
) -> int:
    """Write the readings of the window about (i, j) into values; return how many they are."""
    n, m = depth_mm.shape
    count = 0
    for a in range(max(0, i - half_i), min(n, i + half_i + 1)):
        for b in range(max(0, j - half_j), min(m, j + half_j + 1)):
            if not np.isnan(depth_mm[a, b]):
                values[count] = depth_mm[a, b]
                count += 1
    return count


def windowed_mean(depth_mm: Floats, profiles: int, points: int) -> Floats:
    """Mean of the readings in a window about each reading, (n, m)."""
    seen = np.isfinite(depth_mm)
    total = box_sum(np.where(seen, depth_mm, 0.0), profiles, points)
    count = np.maximum(box_sum(seen.astype(np.float64), profiles, points), 1.0)
    return np.where(seen, total / count, np.nan)


def box_sum(values: Floats, profiles: int, points: int) -> Floats:
    """Sum over a window about each value, nothing beyond the border, (n, m)."""
    return weighted_sum(weighted_sum(values, np.ones(profiles), 0), np.ones(points), 1)


def weighted_sum(values: Floats, weights: Floats, axis: int) -> Floats:
    """Sum of the values about each along one axis, weighted; nothing beyond the border."""
    from scipy.ndimage import correlate1d

    if weights.size == 1:
        return np.asarray(values * weights[0])
    return np.asarray(correlate1d(values, weights, axis=axis, mode="constant"))


@njit(cache=True)
def median_law(
    depth_mm: Floats, sd_mm: Floats, window: Ints
) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean and variance of the median of independent normal readings about each, (n, m).

    Of readings with means μ and one deviation σ the median lies about m with Σ Φ((m - μ)/σ) = n/2
    and has the variance Σ p (1 - p) / (Σ f)², p and f their distributions and densities at m (P. K.
    Sen, J. Multivariate Anal. 1968, not identically distributed). That holds for many; for few it
    is smaller by 2c / (2c + π - 2) (T. Hojo, Biometrika 23 (1931) 315), c = (Σ f)² / Σ f² the
    number that counts at m: all on a flat, one on a steep slope.

    Parameters
    ----------
    depth_mm : means, NaN where missing
    sd_mm : deviation at each
    window : profiles and points, odd

    Returns
    -------
    middle_mm
    variance
        Of readings with σ = 1.
    down, across
        Readings at the median's level in the window's column and in its row, at least 1.
    """
    n, m = depth_mm.shape
    middle, variance = depth_mm.copy(), np.ones((n, m))
    down, across = np.ones((n, m)), np.ones((n, m))
    half_i, half_j = window[0] // 2, window[1] // 2
    values = np.empty((2 * half_i + 1) * (2 * half_j + 1))
    for i in range(n):
        for j in range(m):
            if np.isnan(depth_mm[i, j]):
                continue
            count = _gather(depth_mm, i, j, half_i, half_j, values)
            found = values[:count]
            sd = sd_mm[i, j]
            if sd <= 0.0:
                middle[i, j] = np.median(found)
                continue
            if found.max() - found.min() < FLAT * sd:
                middle[i, j] = found.mean()
                variance[i, j] = math.pi / (2.0 * count + math.pi - 2.0)
            else:
                middle[i, j], variance[i, j] = _median_moments(found, sd)
            down[i, j] = _at_level(
                depth_mm[max(0, i - half_i) : i + half_i + 1, j], middle[i, j], sd
            )
            row = depth_mm[i, max(0, j - half_j) : j + half_j + 1]
            across[i, j] = _at_level(row, middle[i, j], sd)
    return middle, variance, down, across


@njit(cache=True)
def _at_level(values: Floats, level: float, sd: float) -> float:
    """Count values by their density at a level, over that at its peak; 1 at least."""
    total = 0.0
    for value in values:
        if not np.isnan(value):
            away = (value - level) / sd
            total += math.exp(-0.5 * away * away)
    return max(total, 1.0)


@njit(cache=True)
def _median_moments(values: Floats, sd: float) -> tuple[float, float]:
    """Mean of the median, and its variance over σ²; of an even number, both in the middle."""
    count = len(values)
    below, above = _order_law(values, sd, (count - 1) // 2), _order_law(values, sd, count // 2)
    apart = (above[0] - below[0]) / sd
    together = math.exp(-0.25 * apart * apart)
    return 0.5 * (below[0] + above[0]), 0.25 * (below[1] + above[1]) * (1.0 + together)


@njit(cache=True)
def _order_law(values: Floats, sd: float, rank: int) -> tuple[float, float]:
    """Mean, and variance over σ², of the value of a rank from 0."""
    at = _balance(values, sd, rank + 0.5)
    spread, density, squares = 0.0, 0.0, 0.0
    for value in values:
        away = (at - value) / sd
        p = 0.5 * math.erfc(-away * ROOT_HALF)
        f = math.exp(-0.5 * away * away) * PEAK
        spread += p * (1.0 - p)
        density += f
        squares += f * f
    if density < 1e-6:
        return at, 1.0
    c = max(density * density / squares, 1.0)
    return at, spread / density**2 * 2.0 * c / (2.0 * c + math.pi - 2.0)


@njit(cache=True)
def _balance(values: Floats, sd: float, number: float) -> float:
    """Solve Σ Φ((m - μ)/σ) = number by bisection."""
    low, high = values.min() - 4.0 * sd, values.max() + 4.0 * sd
    while high - low > 1e-3 * sd:
        at = 0.5 * (low + high)
        total = 0.0
        for value in values:
            total += 0.5 * math.erfc((value - at) / sd * ROOT_HALF)
        if total > number:
            high = at
        else:
            low = at
    middle: float = 0.5 * (low + high)
    return middle
