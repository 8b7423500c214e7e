"""Whitened columns of components on a patch: dense ones, and sparse indicators.

Values for each profile and for each column have indicators whose whitened form is sparse: a reading
is whitened given a few neighbours.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from diagnosis.components.component import Component, mean_columns
from diagnosis.components.smooth import Ranges
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS
from sensors.view.covariates import COVARIATES

if TYPE_CHECKING:
    from diagnosis.data.patch import Patch
    from diagnosis.model.log_density import Whitened

Floats = NDArray[np.float64]
Places = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Columns:
    """Whitened columns on the readings of a patch that take part.

    Attributes
    ----------
    dense : (d, N) float32; at_dense : (d,) their places in the equations of the recording
    thin : (N, t) sparse; at_thin : (t,)
    """

    dense: NDArray[np.float32]
    at_dense: Places
    thin: sparse.csr_matrix
    at_thin: Places


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Layout:
    """Places of components in the equations of one recording: shared ones, then its own.

    Attributes
    ----------
    shared, own : components with the number of their columns
    """

    shared: tuple[tuple[Component, int], ...]
    own: tuple[tuple[Component, int], ...]

    @property
    def size(self) -> int:
        """All columns."""
        return self.shared_size + sum(k for _, k in self.own)

    @property
    def shared_size(self) -> int:
        """Columns that all recordings share."""
        return sum(k for _, k in self.shared)

    def places(self) -> list[tuple[Component, Places]]:
        """List each component with its places."""
        out, at = [], 0
        for component, k in (*self.shared, *self.own):
            out.append((component, np.arange(at, at + k)))
            at += k
        return out


def columns_on(
    patch: "Patch",
    state: "Whitened",
    layout: Layout,
    ranges: Ranges,
    noise: NoiseModel,
    before: int,
) -> Columns:
    """Whiten the columns of all components on a patch.

    Parameters
    ----------
    before : profiles of the recording's patches before this one
    """
    profiles, columns = np.arange(patch.shape[0]), column_groups(patch.shape[1])
    at_dense = _joined([at for c, at in layout.places() if not c.relaxed.each])
    dense = np.empty((at_dense.size, int(state.used.sum())), dtype=np.float32)
    filled = 0
    thin: list[sparse.csr_matrix] = []
    at_thin: list[Places] = []
    for component, places in layout.places():
        relaxed = component.relaxed
        if relaxed.each == "column":
            ones = np.ones(patch.shape)
            thin.append(state.whitener.indicators(ones, 0 * profiles, columns))
            at_thin.append(places)
        elif relaxed.each == "profile":
            factor = np.ones(patch.shape)
            if relaxed.times:
                factor = factor * np.nan_to_num(COVARIATES[relaxed.times].values(patch.view))
            thin.append(state.whitener.indicators(factor, profiles, 0 * columns))
            at_thin.append(places[before : before + patch.shape[0]])
        else:
            dense[filled : filled + places.size] = _whitened(component, patch, state, ranges, noise)
            filled += places.size
    return Columns(
        dense=dense,
        at_dense=at_dense,
        thin=sparse.hstack(thin, format="csr") if thin else sparse.csr_matrix((len(dense.T), 0)),
        at_thin=_joined(at_thin),
    )


def _whitened(
    component: Component,
    patch: "Patch",
    state: "Whitened",
    ranges: Ranges,
    noise: NoiseModel,
) -> NDArray[np.float32]:
    """Whiten a component's columns (k, N)."""
    if component.placement:  # whitened already, in prior deviations
        return np.stack([state.columns[..., j][state.used] for j in component.placement])
    made = mean_columns(component, patch, ranges, noise) or ()
    if component.own:  # in deviations of the noise
        made = [state.sd_mm * f for f in made]
    return state.whitener.columns(made, state.sd_mm)


def _joined(places: Sequence[Places]) -> Places:
    return np.concatenate([np.zeros(0, dtype=np.int64), *places])


def column_groups(points: int) -> Places:
    """Give each column the number of its group: its own, or one of a few hundred."""
    size = -(-points // SETTINGS.most_columns)
    return np.arange(points) // size
