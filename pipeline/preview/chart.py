"""A scan laid out in mm for an image: which reading each pixel shows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
Numbers = NDArray[Any]

LONGEST_PX = 1500


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Chart:
    """A scan laid out in mm: x along the laser line, travel across; the longer one horizontal.

    `rows` and `columns` say which profile and point each display pixel shows; both ascend in mm.
    """

    x_mm: Floats
    travel_mm: Floats
    rows: Numbers
    columns: Numbers
    order: Numbers
    upright: bool

    @classmethod
    def of(cls, scan: Mapping[str, Any]) -> "Chart":
        """Lay out one scan as read from its shard."""
        depth = scan["depth"]
        middle = np.nanmedian(depth) if np.isfinite(depth).any() else 1.0
        x = scan["ray_x_mm"] + scan["ray_slope"] * middle
        steps = np.linalg.norm(np.diff(scan["pose"][:, :3, 3], axis=0), axis=1)
        travel = np.concatenate([[0.0], np.cumsum(steps)])
        order = np.argsort(x, kind="stable")
        x = x[order]
        span = max(np.ptp(x), np.ptp(travel), 1e-9)
        return cls(
            x_mm=x,
            travel_mm=travel,
            rows=_nearest(travel, span),
            columns=_nearest(x, span),
            order=order,
            upright=bool(np.ptp(x) >= np.ptp(travel)),
        )

    def image(self, values: Numbers) -> Numbers:
        """Pick what each pixel shows, (height, width)."""
        picked = values[:, self.order][np.ix_(self.rows, self.columns)]
        return np.asarray(picked if self.upright else picked.T)

    def largest(self, values: Numbers) -> Numbers:
        """Like `image`, but the largest value in each pixel, so that no thin crack is lost."""
        pooled: Numbers = np.maximum.reduceat(values[:, self.order], self.rows, axis=0)
        pooled = np.maximum.reduceat(pooled, self.columns, axis=1)
        return np.asarray(pooled if self.upright else pooled.T)

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Edges for imshow with the origin at the lower left."""
        x = (float(self.x_mm[0]), float(self.x_mm[-1]))
        travel = (float(self.travel_mm[0]), float(self.travel_mm[-1]))
        return (*x, *travel) if self.upright else (*travel, *x)

    @property
    def backdrop(self) -> dict[str, Any]:
        """What imshow has to know."""
        return {"extent": self.extent_mm, "origin": "lower", "interpolation": "nearest"}

    @property
    def width_mm(self) -> float:
        """Length of the longer side, mm."""
        return self.extent_mm[1] - self.extent_mm[0]

    @property
    def height_mm(self) -> float:
        """Length of the shorter side, mm."""
        return self.extent_mm[3] - self.extent_mm[2]

    def name_axes(self, axes: "Axes") -> None:
        """Label the axes of an image."""
        along, across = "x along the laser line, mm", "travel, mm"
        axes.set_xlabel(along if self.upright else across)
        axes.set_ylabel(across if self.upright else "x, mm")
        axes.tick_params(labelsize=9)
        axes.set_aspect("equal")


def _nearest(place_mm: Floats, span_mm: float) -> Numbers:
    """Return the sample that each of evenly spaced pixels shows, never descending."""
    count = max(2, min(LONGEST_PX, round(LONGEST_PX * float(np.ptp(place_mm)) / span_mm)))
    even = np.linspace(place_mm[0], place_mm[-1], count)
    between = (place_mm[1:] + place_mm[:-1]) / 2
    return np.asarray(np.searchsorted(between, even))
