"""Peak finders: where along a chip column the line is, as real cameras compute it."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

KINDS = ("maximum", "gravity", "gravity_all", "zero_crossing", "threshold")


@dataclass(frozen=True, kw_only=True, slots=True)
class PeakFinder:
    """Detector settings.

    Attributes
    ----------
    kind
        ``maximum``: brightest pixel with the parabola through its neighbours;
        ``gravity``: centre of gravity of the run above the threshold around the brightest;
        ``gravity_all``: of all pixels of the column above it; ``zero_crossing``: of a
        seven-tap derivative; ``threshold``: middle between the two crossings.
    threshold
        Share of the converter's full scale below which a pixel is not light.
    fraction_bits
        Binary digits of the row that are delivered.
    """

    kind: str = "gravity"
    threshold: float = 0.03
    fraction_bits: int = 6


@njit(cache=True)
def locate(
    level: NDArray[np.float64], rows: int, kind: int, threshold: float
) -> tuple[float, float]:
    """Find the line in one column.

    Parameters
    ----------
    level : (rows,)
        Converter counts.
    kind : int
        Index into `KINDS`.
    threshold : float
        Counts.

    Returns
    -------
    row, peak : float
        Sub-pixel row (NaN without a line) and the brightest count.
    """
    top = 0
    for r in range(1, rows):
        if level[r] > level[top]:
            top = r
    peak = level[top]
    if peak < threshold or top == 0 or top == rows - 1:
        return np.nan, peak
    if kind == 0:
        a, b, c = level[top - 1], level[top], level[top + 1]
        bend = a - 2 * b + c
        return (top + 0.5 * (a - c) / bend if bend < 0 else float(top)), peak
    low, high = top, top
    while low > 0 and level[low - 1] >= threshold:
        low -= 1
    while high < rows - 1 and level[high + 1] >= threshold:
        high += 1
    if kind == 1 or kind == 2:
        first, last = (low, high) if kind == 1 else (0, rows - 1)
        weight, moment = 0.0, 0.0
        for r in range(first, last + 1):
            if level[r] > threshold:
                # what exceeds the threshold, so that a pixel fades in rather than jumps in
                weight += level[r] - threshold
                moment += (level[r] - threshold) * r
        return (moment / weight if weight > 0 else float(top)), peak
    if kind == 3:
        before = 0.0
        for r in range(max(low - 3, 3), min(high + 4, rows - 3)):
            now = (
                level[r + 1] + level[r + 2] + level[r + 3]
                - level[r - 1] - level[r - 2] - level[r - 3]
            )  # fmt: skip
            if r >= top - 2 and before > 0 and now <= 0:
                return r - 1 + before / (before - now), peak
            before = now
        return np.nan, peak
    if low == 0 or high == rows - 1:  # the line runs off the chip: it crosses on one side only
        return np.nan, peak
    rise = low - (level[low] - threshold) / max(level[low] - level[low - 1], 1e-9)
    fall = high + (level[high] - threshold) / max(
        level[high] - level[high + 1], 1e-9
    )
    return 0.5 * (rise + fall), peak
