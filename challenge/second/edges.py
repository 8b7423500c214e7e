"""Where a surface has edges: places off them are those that instruments read without a doubt."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_BEND_MM = 0.005  # second difference beyond which a reading isn't off edges


def off_edges(truth_mm: Floats) -> NDArray[np.bool_]:
    """Places where the surface doesn't bend within two profiles and two columns."""
    flat = np.isfinite(truth_mm)
    for axis in (0, 1):
        bend = np.abs(np.diff(np.nan_to_num(truth_mm, nan=1e3), 2, axis=axis))
        ends = [(1, 1) if a == axis else (0, 0) for a in (0, 1)]
        flat &= np.pad(bend, ends, constant_values=np.inf) < _BEND_MM
    wide = np.pad(flat, 2, constant_values=False)
    windows = np.lib.stride_tricks.sliding_window_view(wide, (5, 5))
    return np.asarray(windows.all(axis=(-2, -1)))
