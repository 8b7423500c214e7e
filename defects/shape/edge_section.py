"""The section across a feature edge: where its faces lie under a plane that cuts the edge off."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from defects.seats.feature_edges import Frames
from defects.surface.surface import SiteError

Floats = NDArray[np.float64]

SHARPEST_MM = 1e-6


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class EdgeSection:
    """Depths along the bisector at an outer edge whose faces are cut at two reaches.

    With x across the edge (square to the bisector) and depth counted from the edge along the
    bisector into the part, the left face passes through (`left_x`, `left_depth`), the right one
    through (-`right_x`, `right_depth`), and the cutting plane joins these points.

    Parameters
    ----------
    left_x, right_x, left_depth, right_depth
        See above, mm, above zero.
    """

    left_x: float
    right_x: float
    left_depth: float
    right_depth: float

    @classmethod
    def of(cls, frames: Frames, reach_mm: tuple[float, float]) -> Self:
        """Return the section, averaged over the frames, of reaches on the left and right face."""
        sideways = np.cross(frames.outward, frames.along)
        x = [float(np.mean(np.sum(side * sideways, axis=1)))
             for side in (frames.left, frames.right)]  # fmt: skip
        fall = [-float(np.mean(np.sum(side * frames.outward, axis=1)))
                for side in (frames.left, frames.right)]  # fmt: skip
        left, right = reach_mm
        section = cls(
            left_x=left * x[0], right_x=-right * x[1], left_depth=left * fall[0],
            right_depth=right * fall[1],
        )  # fmt: skip
        if min(section.left_x, section.right_x, section.left_depth, section.right_depth) < (
            SHARPEST_MM
        ):
            raise SiteError("the edge is too blunt or too sharp for a flaw")
        return section

    @property
    def depth_mm(self) -> float:
        """Return the plane's depth under the edge itself."""
        span = self.left_x + self.right_x
        return (self.left_depth * self.right_x + self.right_depth * self.left_x) / span

    def skin(self, across: Floats) -> Floats:
        """Return the depth of the faces at positions across, in reaches, left above zero."""
        return np.where(across > 0, across * self.left_depth, -across * self.right_depth)

    def plane(self, across: Floats) -> Floats:
        """Return the depth of the cutting plane there."""
        x = np.where(across > 0, across * self.left_x, across * self.right_x)
        slope = (self.left_depth - self.right_depth) / (self.left_x + self.right_x)
        return self.depth_mm + slope * x

    def middle(self, across: Floats) -> Floats:
        """Return positions from -1 to 1 between the two cuts, 0 midway along the plane."""
        x = np.where(across > 0, across * self.left_x, across * self.right_x)
        half = (self.left_x + self.right_x) / 2
        return np.asarray((x - (self.left_x - self.right_x) / 2) / half)
