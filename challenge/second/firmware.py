"""What the instrument does to its profiles before it delivers them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Firmware:
    """Filters and number format.

    Attributes
    ----------
    median : readings of a profile that a median takes, 1 for none
    gap : longest run of missing readings that is filled between its neighbours
    step_mm : of a count
    stuck_bit : number of a bit that sticks at one, -1 for none
    lost : share of readings that the link to the host loses
    """

    median: int = 1
    gap: int = 0
    step_mm: float = 1e-3
    stuck_bit: int = -1
    lost: float = 0.0

    def deliver(
        self, depth_mm: Floats, lowest_mm: float, rng: np.random.Generator | None = None
    ) -> Floats:
        """Filter depths (n, m), and count them in 16 bits whose 0 is the sentinel of no reading.

        Parameters
        ----------
        lowest_mm : depth of count 0
        rng : of what the link loses
        """
        out = _median(depth_mm, self.median) if self.median > 1 else depth_mm
        if self.gap > 0:
            out = np.stack([_filled(row, self.gap) for row in out])
        counts = np.where(np.isfinite(out), np.round((out - lowest_mm) / self.step_mm), 0)
        counts = np.where((counts > 0) & (counts < 65536), counts, 0).astype(np.int64)
        if self.stuck_bit >= 0:
            counts = np.where(counts > 0, counts | (1 << self.stuck_bit), 0)
        if self.lost > 0 and rng is not None:
            counts = np.where(rng.random(counts.shape) < self.lost, 0, counts)
        return np.where(counts > 0, lowest_mm + counts * self.step_mm, np.nan)


def _median(depth: Floats, width: int) -> Floats:
    """Median along the line of what is there; readings that are missing stay so."""
    padded = np.pad(depth, ((0, 0), (width // 2, width // 2)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, width, axis=1)
    out, seen = depth.copy(), np.isfinite(depth)
    out[seen] = np.nanmedian(windows[seen], axis=-1)
    return out


def _filled(row: Floats, longest: int) -> Floats:
    """Fill short gaps of one profile linearly; not at its ends."""
    seen = np.flatnonzero(np.isfinite(row))
    if seen.size < 2:
        return row
    at = np.arange(row.size)
    before = np.searchsorted(seen, at, side="right") - 1
    after = np.minimum(before + 1, seen.size - 1)
    run = np.where(before >= 0, seen[after] - seen[np.maximum(before, 0)] - 1, row.size)
    inside = np.isnan(row) & (before >= 0) & (at < seen[-1]) & (run <= longest)
    return np.where(inside, np.interp(at, seen, row[seen]), row)
