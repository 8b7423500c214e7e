"""The law of a cause as a form of its component: a component's columns as the law combines them.

A component draws any smooth function of what its cause follows, so that a cause is found whose
formula is another. Where the catalogue's formula is nature's, the readings are as probable with few
numbers as with many, and a component that is freer explains them no better by its freedom.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.component import Component, curve_columns
from diagnosis.components.smooth import Ranges
from diagnosis.fields import Single
from files.errors import RecipeError
from sensors.effects import CATALOGUE
from sensors.effects.base import Effect
from sensors.view.view import View

if TYPE_CHECKING:
    from diagnosis.data.patch import Patch

Floats = NDArray[np.float64]
ROUNDED = 1e-9
"""Share of the largest squared column below which what a placement leaves is rounding."""
EVERY = 7
"""One of so many readings tells how a law follows covariates."""


def law_forms(
    component: Component, patches: Sequence["Patch"], ranges: Ranges
) -> tuple[Floats, ...]:
    """Combine a component's columns (k,) to its law's fields, (k, f) for each point of its grid.

    Least squares over readings off edges, beyond where each recording lay. None for a law that is
    no curve of covariates, or is in nothing linear, and for one that is as free as its component.
    """
    relaxed = component.relaxed
    if not component.effect or not relaxed.along or relaxed.periodic or not patches:
        return ()
    points = CATALOGUE[component.effect].example().grid(patches[0].view)
    products: dict[int, Floats] = {}
    count = size = 0
    for patch in patches:
        columns = curve_columns(component, patch.view, ranges)
        of_points = [_fields(point, patch.view) for point in points]
        if columns is None or not all(of_points):
            return ()
        fields = [f for own in of_points for f in own]
        count, size = len(columns), len(columns) + len(fields)
        pick = np.flatnonzero(patch.observed & ~patch.edge)[::EVERY]
        placement = np.moveaxis(patch.columns, -1, 0)
        x = _picked([*columns, *fields, *placement], patch.shape, pick)
        products[patch.recording] = products.get(patch.recording, 0.0) + x.T @ x
    if (size - count) // len(points) >= count:
        return ()
    left = np.sum([_beyond(p, size) for p in products.values()], axis=0)
    found = np.linalg.lstsq(left[:count, :count], left[:count, count:], rcond=ROUNDED)[0]
    return tuple(np.split(found, len(points), axis=1))


def _beyond(products: Floats, size: int) -> Floats:
    """Project out of products (size + p, size + p) what is in line with the last ones."""
    across, last = products[:size, size:], products[size:, size:]
    return np.asarray(products[:size, :size] - across @ np.linalg.pinv(last) @ across.T)


def _fields(point: Effect, view: View) -> Sequence[Floats]:
    """Fields of a law that is linear in something; none elsewhere."""
    try:
        basis = point.basis(view)
    except RecipeError:
        return ()
    return () if basis is None else basis.fields


def _picked(
    fields: Sequence[Floats | Single], shape: tuple[int, int], pick: NDArray[np.int64]
) -> Floats:
    """Values (N, f) of fields at readings; 0 where one isn't known."""
    values = np.stack([np.broadcast_to(f, shape).ravel()[pick] for f in fields], axis=1)
    return np.asarray(np.nan_to_num(values), dtype=np.float64)
