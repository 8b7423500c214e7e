"""Depth edges along the travel: distance from each point, and height of the step."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sensors.view.view import View

Floats = NDArray[np.float64]

STEEPEST = 4.0
"""Depth rise over travel between two profiles beyond which there is an edge (76°)."""


def edge_offset_mm(view: "View") -> Floats:
    """Signed distance along y to the nearest depth edge in the same column, (n, m) mm.

    Positive: the edge lies towards +y of the sensor. An edge lies halfway between two profiles
    whose depths differ by more than `STEEPEST` times their distance, or of which one alone has
    a return. NaN at missing readings, or in a column without an edge.
    """
    n, m = view.shape
    if n < 2:
        return np.full((n, m), np.nan)
    depth, travel = view.depth_mm, view.travel_mm
    gap = np.abs(np.diff(travel))[:, None]
    jump = np.abs(np.diff(depth, axis=0)) > STEEPEST * gap
    jump |= view.in_range[1:] != view.in_range[:-1]
    middle = np.broadcast_to(0.5 * (travel[1:] + travel[:-1])[:, None], jump.shape)
    place = np.where(jump, middle, np.nan)
    blank = np.full((1, m), np.nan)
    before = _carried(np.concatenate([blank, place])) - travel[:, None]
    after = _carried(np.concatenate([place, blank])[::-1])[::-1] - travel[:, None]
    nearer = ~(np.abs(before) > np.abs(after))
    offset = np.where(nearer & np.isfinite(before) | ~np.isfinite(after), before, after)
    return np.where(view.in_range, offset, np.nan)


def edge_height_mm(view: "View") -> Floats:
    """Depth step at the nearest edge, (n, m) mm.

    Positive on the near (upper) level; infinite where nothing lies beyond; NaN without an edge.
    """
    offset = edge_offset_mm(view)
    n, m = view.shape
    out = np.full((n, m), np.nan)
    rows, columns = np.nonzero(np.isfinite(offset))
    if rows.size == 0:
        return out
    travel = view.travel_mm
    forward = travel[-1] >= travel[0]
    target = travel[rows] + offset[rows, columns]
    order = travel if forward else travel[::-1]
    ahead = (offset[rows, columns] > 0) == forward
    cut = np.searchsorted(order, target)
    cut = cut if forward else n - cut
    beyond = np.clip(np.where(ahead, cut, cut - 1), 0, n - 1)
    far = view.depth_mm[beyond, columns]
    out[rows, columns] = np.where(np.isnan(far), np.inf, far - view.depth_mm[rows, columns])
    return out


def _carried(place: Floats) -> Floats:
    """Carry the last finite value of each column forward."""
    index = np.where(np.isfinite(place), np.arange(len(place))[:, None], -1)
    last = np.maximum.accumulate(index, axis=0)
    carried = np.take_along_axis(place, np.maximum(last, 0), axis=0)
    return np.where(last >= 0, carried, np.nan)
