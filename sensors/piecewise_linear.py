"""Piecewise linear functions: a hat for each knot."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def hats(count: int, columns: int) -> Floats:
    """Return hat functions (count, columns) at knots spread evenly over the columns.

    Their sum is one everywhere; a single hat is the constant.
    """
    if count == 1:
        return np.ones((1, columns))
    place = np.arange(columns) * ((count - 1) / max(columns - 1, 1))
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place - np.arange(count)[:, None])))


def hats_at(values: Floats, knots: Floats) -> Floats:
    """Return hat functions (count, ...) of rising `knots` at `values`, constant beyond the ends."""
    place = np.interp(values, knots, np.arange(len(knots)))
    distance = np.abs(place[None, ...] - np.arange(len(knots)).reshape(-1, *[1] * place.ndim))
    return np.asarray(np.maximum(0.0, 1.0 - distance))
