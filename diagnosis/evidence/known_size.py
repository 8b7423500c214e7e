"""Evidence for the size of a departure that is measured as one number.

Where the departure's sizes have the deviation s and the number h is known with the deviation σ,

    ln BF(s) = ln N(h; 0, σ² + s²) - ln N(h; 0, σ²).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def factors_of_value(value: float, unsure: float, sizes: Floats) -> Floats:
    """Log Bayes factor of each size (S,) against none."""
    wide = unsure**2 + np.square(sizes)
    return np.asarray(0.5 * (value**2 * (unsure**-2 - 1 / wide) - np.log(wide / unsure**2)))
