"""Exposures of a profile: two that are merged, and a control that sets how long they are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FACTORS = 1 / 16, 16.0
"""How far the control may go from the nominal exposure."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Exposures:
    """Merged exposures and automatic control.

    Attributes
    ----------
    ratio
        How much longer the first exposure is than the second, which columns that saturate are
        taken from; 1 for one exposure.
    gain, target
        The control's exponent, 0 for none, and the brightness that it aims at. It acts on the
        profile before the last: log e' = log e - gain (log b - log target), one profile late.
    """

    ratio: float = 1.0
    gain: float = 0.0
    target: float = 0.6

    def next_factor(self, factor: float, brightness: float) -> float:
        """Exposure of the next profile, in nominal ones, after a brightness seen one earlier."""
        if self.gain == 0 or not brightness > 0:
            return factor
        wanted = factor * (self.target / brightness) ** self.gain
        return float(np.clip(wanted, *FACTORS))

    def merged(
        self, first: tuple[Floats, Floats], second: tuple[Floats, Floats]
    ) -> tuple[Floats, Floats]:
        """Rows and brightness of two exposures: the second where the first saturates."""
        full = first[1] >= 1.0
        row = np.where(full, second[0], first[0])
        return row, np.where(full, second[1], first[1] / self.ratio)
