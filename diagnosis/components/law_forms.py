"""The law of a cause as a form of its component: a component's columns as the law combines them.

A component draws any smooth function of what its cause follows, so that a cause is found whose
formula is another. Where the catalogue's formula is nature's, the readings are as probable with few
numbers as with many, and a component that is freer explains them no better by its freedom.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.component import Component, axes_of, curve_columns
from diagnosis.components.smooth import Ranges, products
from diagnosis.fields import Single
from files.errors import RecipeError
from sensors.effects import CATALOGUE
from sensors.effects.base import Effect
from sensors.view.view import View
from sensors.view.view_cache import ViewCache

if TYPE_CHECKING:
    from diagnosis.data.patch import Patch

Floats = NDArray[np.float64]
_FIELDS: ViewCache[Floats | None] = ViewCache(32)
ROUNDED = 1e-9
"""Share of the largest squared column below which what a placement leaves is rounding."""
EVERY = 7
"""One of so many readings tells how a law follows covariates."""


def law_forms(
    component: Component, patches: Sequence["Patch"], ranges: Ranges
) -> tuple[Floats, ...]:
    """Combine a component's columns (k,) to its law's fields, (k, f) for each point of its grid.

    Least squares over readings off edges, beyond where each recording lay. None for a law that is
    no curve of covariates, or is in nothing linear, and for one that is as free as its component. A
    series is no formula: of what a part does, a bend of one curvature about one of its sides is.
    """
    relaxed = component.relaxed
    if not component.effect or not relaxed.along or relaxed.periodic or not patches:
        return ()
    kind = CATALOGUE[component.effect]
    if any(p.linear and p.kind == "list" for p in kind.parameters()):
        return _bends(component, patches[0], ranges)
    points = kind.example().grid(patches[0].view)
    sums: dict[int, Floats] = {}
    count = size = 0
    for patch in patches:
        pick = np.flatnonzero(patch.observed & ~patch.edge)[::EVERY]
        columns = curve_columns(component, patch.view, ranges)
        fields = _fields(points, patch.view, pick)
        if columns is None or fields is None:
            return ()
        count, size = len(columns), len(columns) + fields.shape[1]
        drawn = _picked(columns, patch.shape, pick)
        lies = _picked(list(np.moveaxis(patch.columns, -1, 0)), patch.shape, pick)
        x = np.concatenate([drawn, fields, lies], axis=1)
        sums[patch.recording] = sums.get(patch.recording, 0.0) + x.T @ x
    if (size - count) // len(points) >= count:
        return ()
    left = np.sum([_beyond(p, size) for p in sums.values()], axis=0)
    found = np.linalg.lstsq(left[:count, :count], left[:count, count:], rcond=ROUNDED)[0]
    return tuple(np.split(found, len(points), axis=1))


def _bends(component: Component, patch: "Patch", ranges: Ranges) -> tuple[Floats, ...]:
    """Pick the column (k, 1) of each axis that is a parabola of it alone."""
    columns = curve_columns(component, patch.view, ranges)
    if columns is None:
        return ()
    sides = axes_of(component.relaxed, ranges)
    alone = np.array(products(len(sides), even=component.relaxed.even))
    first = len(columns) - len(alone)
    return tuple(
        np.eye(len(columns))[:, first + np.flatnonzero((alone == bend).all(axis=1))]
        for bend in 2 * np.eye(len(sides), dtype=np.int64)
    )


def _beyond(sums: Floats, size: int) -> Floats:
    """Project out of X'X (size + p, size + p) what is in line with the last columns."""
    across, last = sums[:size, size:], sums[size:, size:]
    return np.asarray(sums[:size, :size] - across @ np.linalg.pinv(last) @ across.T)


def _fields(points: Sequence[Effect], view: View, pick: NDArray[np.int64]) -> Floats | None:
    """Fields (N, f) at readings of laws that are linear in something; None where one isn't.

    Kept with the view: they are the same whatever a model says.
    """
    key = *points, hash(pick.tobytes())
    return _FIELDS.get(view, key, lambda: _made(points, view, pick))


def _made(points: Sequence[Effect], view: View, pick: NDArray[np.int64]) -> Floats | None:
    out: list[Floats] = []
    for point in points:
        try:
            basis = point.basis(view)
        except RecipeError:
            return None
        if basis is None or not basis.fields:
            return None
        out += basis.fields
    return _picked(out, view.shape, pick)


def _picked(
    fields: Sequence[Floats | Single], shape: tuple[int, int], pick: NDArray[np.int64]
) -> Floats:
    """Values (N, f) of fields at readings; 0 where one isn't known."""
    values = np.stack([np.broadcast_to(f, shape).ravel()[pick] for f in fields], axis=1)
    return np.asarray(np.nan_to_num(values), dtype=np.float64)
