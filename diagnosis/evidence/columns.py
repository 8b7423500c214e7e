"""Whitened columns of components on a patch: dense ones, and sparse indicators.

Values for each profile and for each column have indicators whose whitened form is sparse. A
reading is whitened given neighbours up to 3 profiles and 3 columns away, so that combs whose teeth
are further apart hold many indicators at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from diagnosis.components.component import Component, mean_columns
from diagnosis.components.smooth import Ranges
from diagnosis.noise import Mask, NoiseModel
from diagnosis.patch import Patch
from diagnosis.score import Whitened
from diagnosis.settings import SETTINGS
from sensors.view.covariates import COVARIATES

Floats = NDArray[np.float64]
Places = NDArray[np.int64]
COMB = 8
"""Spacing of a comb's teeth."""
REACH = 4
"""Profiles over which a whitened tooth reaches."""
LEFT = 2
"""Columns before a tooth from which its reach counts."""


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
    patch: Patch,
    state: Whitened,
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
    pick = state.used
    dense: list[NDArray[np.float32]] = []
    at_dense: list[Places] = []
    thin: list[sparse.csr_matrix] = []
    at_thin: list[Places] = []
    for component, places in layout.places():
        relaxed = component.relaxed
        if relaxed.each == "column":
            thin.append(_each_column(state, pick))
            at_thin.append(places)
        elif relaxed.each == "profile":
            factor = None
            if relaxed.times:
                values = COVARIATES[relaxed.times].values(patch.view)
                factor = np.nan_to_num(np.broadcast_to(values, patch.shape))
            thin.append(_each_profile(state, pick, factor))
            at_thin.append(places[before : before + patch.shape[0]])
        else:
            made = mean_columns(component, patch, ranges, noise) or ()
            if component.own:  # in deviations of the noise
                made = [state.sd_mm * f for f in made]
            dense.append(state.whitener.columns(made, state.sd_mm))
            at_dense.append(places)
    count = int(pick.sum())
    return Columns(
        dense=np.concatenate(dense) if dense else np.zeros((0, count), dtype=np.float32),
        at_dense=_joined(at_dense),
        thin=sparse.hstack(thin, format="csr") if thin else sparse.csr_matrix((count, 0)),
        at_thin=_joined(at_thin),
    )


def _joined(places: Sequence[Places]) -> Places:
    return np.concatenate([np.zeros(0, dtype=np.int64), *places])


def _each_profile(state: Whitened, pick: Mask, factor: Floats | None) -> sparse.csr_matrix:
    """Whitened indicator of each profile, in deviations of the noise, (N, n)."""
    n, _ = pick.shape
    field = state.sd_mm if factor is None else factor * state.sd_mm
    number = np.broadcast_to(np.arange(n)[:, None], pick.shape)[pick]
    entries = []
    for tooth in range(COMB):
        comb = np.where((np.arange(n) % COMB == tooth)[:, None], field, 0.0)
        value = state.whiten(comb)[pick]
        owner = number - (number - tooth) % COMB
        near = np.flatnonzero((owner >= 0) & (number - owner < REACH) & (value != 0))
        entries.append((value[near], near, owner[near]))
    return _assembled(entries, int(pick.sum()), n)


def column_groups(points: int) -> Places:
    """Give each column the number of its group: its own, or one of a few hundred."""
    size = -(-points // SETTINGS.most_columns)
    return np.arange(points) // size


def _each_column(state: Whitened, pick: Mask) -> sparse.csr_matrix:
    """Whitened indicator of each column, or group of columns, in deviations of the noise."""
    group = column_groups(pick.shape[1])
    m = int(group[-1]) + 1
    number = np.broadcast_to(group[None], pick.shape)[pick]
    entries = []
    for tooth in range(COMB):
        comb = np.where((group % COMB == tooth)[None], state.sd_mm, 0.0)
        value = state.whiten(comb)[pick]
        owner = number + LEFT - (number + LEFT - tooth) % COMB
        near = np.flatnonzero((owner >= 0) & (owner < m) & (value != 0))
        entries.append((value[near], near, owner[near]))
    return _assembled(entries, int(pick.sum()), m)


def _assembled(
    entries: Sequence[tuple[Floats, Places, Places]], rows: int, columns: int
) -> sparse.csr_matrix:
    value, where, owner = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.csr_matrix((value, (where, owner)), shape=(rows, columns))
