"""A panel of a story's picture, and what panels share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, slots=True)
class Panel:
    """A panel: its title, and what draws it on an axis."""

    title: str
    draw: Callable[[Any], None]


def name_axes(axis: Any) -> None:
    """Label the axes of a map."""
    axis.set_xlabel("point of the profile", fontsize=8)
    axis.set_ylabel("profile", fontsize=8)


def robust_sd(rest: NDArray[np.float64]) -> float:
    """Return the standard deviation by the median, of finite values."""
    known = rest[np.isfinite(rest)]
    return float(1.4826 * np.median(np.abs(known - np.median(known)))) + 1e-12
