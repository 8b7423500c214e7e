"""A monotone map of heights: what turns a standardised noise into a surface's own distribution."""

import functools
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class HeightMap:
    """Monotone piecewise cubic through knots (Fritsch-Carlson slopes), straight beyond the ends.

    Parameters
    ----------
    knots : tuple of float
        Rising values of the standardised noise (in standard deviations).
    values : tuple of float
        Their heights, never falling, in units of the field's amplitude.
    """

    knots: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.knots) != len(self.values) or len(self.knots) < 2:
            raise ValueError("as many values as knots, and at least two")
        if np.any(np.diff(self.knots) <= 0.0) or np.any(np.diff(self.values) < 0.0):
            raise ValueError("knots must rise and values must not fall")

    def __call__(self, u: Floats) -> Floats:
        """Map standardised values of any shape to heights."""
        out = np.array(u, dtype=np.float64)
        self.apply(out, 1.0)
        return out

    def apply(self, u: Floats, amplitude: float) -> None:
        """Replace u by amplitude times its height, in place."""
        _apply(u.reshape(-1), *_coefficients(self, amplitude))


@functools.lru_cache(maxsize=64)
def _coefficients(heights: HeightMap, amplitude: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return knots, values and slopes there, and the cubics between them (3, k - 1)."""
    knots = np.asarray(heights.knots, dtype=np.float64)
    values = np.asarray(heights.values, dtype=np.float64)
    values, slopes = amplitude * values, amplitude * _slopes(knots, values)
    step, rise = np.diff(knots), np.diff(values)
    first = step * slopes[:-1]
    cubic = np.stack([first, 3 * rise - 2 * first - step * slopes[1:],
                      first + step * slopes[1:] - 2 * rise])  # fmt: skip
    return knots, values, slopes, cubic


def _slopes(knots: Floats, values: Floats) -> Floats:
    """Slopes at the knots that keep the cubic monotone (Fritsch and Butland 1984)."""
    step = np.diff(knots)
    secant = np.diff(values) / step
    slopes = np.empty_like(knots)
    slopes[0], slopes[-1] = secant[0], secant[-1]
    left, right = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    flat = (secant[:-1] <= 0.0) | (secant[1:] <= 0.0)
    with np.errstate(divide="ignore", over="ignore"):  # a secant of nothing: its mean is nothing
        mean = (left + right) / (left / secant[:-1] + right / secant[1:])
    slopes[1:-1] = np.where(flat, 0.0, mean)
    return slopes


@njit(cache=True)
def _apply(u: Floats, knots: Floats, values: Floats, slopes: Floats, cubic: Floats) -> None:
    """Replace u by heights; `cubic` (3, k - 1) are each interval's coefficients, s, s² and s³."""
    last = knots.size - 1
    # evenly spaced bins that name the first interval to look at
    bins = 16 * last
    per_bin = bins / (knots[last] - knots[0])
    first = np.zeros(bins, dtype=np.int64)
    for b in range(bins):
        start = knots[0] + b / per_bin
        low = first[b - 1] if b else 0
        while low < last - 1 and knots[low + 1] <= start:
            low += 1
        first[b] = low
    for i in range(u.size):
        t = u[i]
        if not t > knots[0]:
            u[i] = values[0] + slopes[0] * (t - knots[0])
        elif t >= knots[last]:
            u[i] = values[last] + slopes[last] * (t - knots[last])
        else:
            low = first[min(int((t - knots[0]) * per_bin), bins - 1)]
            while low < last - 1 and knots[low + 1] <= t:
                low += 1
            s = (t - knots[low]) / (knots[low + 1] - knots[low])
            bend = cubic[1, low] + s * cubic[2, low]
            u[i] = values[low] + s * (cubic[0, low] + s * bend)
