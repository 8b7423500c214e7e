"""Fields that the change of a mean is a sum of."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Basis:
    """Change of the mean = sum of coefficient times field.

    Attributes
    ----------
    names : (k,) names of the coefficients
    fields : k arrays that broadcast to (n, m), mm per unit of the coefficient; NaN where unknown
    """

    names: tuple[str, ...]
    fields: tuple[Floats, ...]
