"""Arrays over the readings of a scan."""

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float64]
"""Numbers of readings, mostly (n, m): profiles by columns."""
Single = NDArray[np.float32]
"""The same in single precision: several numbers of each reading, kept for a whole scan."""
Mask = NDArray[np.bool_]
"""Which readings, (n, m)."""
