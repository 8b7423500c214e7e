"""Brightness of a part's surface: what a scan needs to know of it."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Albedo(Protocol):
    """Brightness of the part's surface, as `sensors.surface.reflectance` describes it."""

    @property
    def cell_mm(self) -> float:
        """Side of cells within which a border's place isn't known; 0 where it is."""
        ...

    def at(self, part_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the reflectance (...,) at points (..., 3) of the part, 0 to 1."""
        ...
