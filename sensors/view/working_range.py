"""Where first hits lie in the working range, in one compiled pass."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def reasons(
    depth_mm: NDArray[np.float64], least_mm: float, most_mm: float
) -> NDArray[np.uint8]:
    """Return why each hit (n, m) gives no reading, as the numbers of `Reason`.

    0 within the working range, 1 without a hit (NaN), 2 beyond the range.
    """
    n, m = depth_mm.shape
    reason = np.empty((n, m), dtype=np.uint8)
    for i in range(n):
        for j in range(m):
            depth = depth_mm[i, j]
            inside = depth >= least_mm and depth <= most_mm
            reason[i, j] = 0 if inside else 1 if np.isnan(depth) else 2
    return reason
