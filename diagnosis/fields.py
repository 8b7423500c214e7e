"""Arrays over the readings of a scan."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

Field = NDArray[np.float64]
"""Numbers of readings, mostly (n, m): profiles by columns."""
Single = NDArray[np.float32]
"""The same in single precision: several numbers of each reading, kept for a whole scan."""
Mask = NDArray[np.bool_]
"""Which readings, (n, m)."""


def median_sd(away: Field) -> float:
    """Return the standard deviation of normal deviations by their median, in their unit.

    1.4826 times the median of absolute deviations (Hampel 1974, JASA 69:383): up to half of them
    may lie anywhere. `away` are deviations, from zero or from a middle, in any shape; there is
    at least one.
    """
    return 1.4826 * float(np.median(np.abs(away)))


def widened(mask: Mask, reach: Sequence[int]) -> Mask:
    """Dilate a mask (n, m) by profiles and points of reach, within a rectangle, axis by axis."""
    window = [2 * one + 1 for one in reach]
    return np.asarray(maximum_filter(mask, size=window, mode="constant"))
