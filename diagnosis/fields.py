"""Arrays over the readings of a scan."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Field = NDArray[Any]
"""Numbers of readings, mostly (n, m): profiles by columns."""
Mask = NDArray[np.bool_]
"""Which readings, (n, m)."""
