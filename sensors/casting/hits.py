"""First hits of a scan's rays on a mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Hits:
    """First hits of a scan's rays, whatever their depth.

    Attributes
    ----------
    depth_mm : (n, m) float64
        Depth in the sensor frame, mm; NaN where the ray meets nothing.
    triangle : (n, m) int32
        Number of the triangle; -1 where the ray meets nothing.
    """

    depth_mm: NDArray[np.float64]
    triangle: NDArray[np.int32]

    def rows(self, part: slice) -> "Hits":
        """Return the hits of some of the profiles."""
        return Hits(depth_mm=self.depth_mm[part], triangle=self.triangle[part])

    @classmethod
    def joined(cls, parts: Sequence["Hits"]) -> "Hits":
        """Return the hits of several scans as those of one, profile after profile."""
        return cls(
            depth_mm=np.concatenate([hits.depth_mm for hits in parts]),
            triangle=np.concatenate([hits.triangle for hits in parts]),
        )
