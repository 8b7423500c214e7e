"""Whole columns: offsets and scales of the profile's columns, the same in every recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize, minimize_scalar
from scipy.sparse import csr_matrix

from diagnosis.data.patch import Patch
from diagnosis.fields import Field, Mask
from diagnosis.model.log_density import Whitened
from diagnosis.settings import SETTINGS

COMB = 6
"""An innovation sees columns from three before to two after: columns six apart never meet."""
SEARCHED = {"xatol": 0.05, "fatol": 0.05}
"""Two variances to a twentieth: what is shrunk by them changes by far less."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Columns:
    """Normal equations of the columns' offsets (mm), the pose projected out.

    Attributes
    ----------
    gram : (k, k); right : (k,)
        Where they tilt, the offsets' first and then as many slopes.
    tilted : whether there are slopes (mm for each mm away from the working distance)
    """

    gram: Field
    right: Field
    tilted: bool

    def level(self) -> "Columns":
        """Return the equations of columns that don't tilt."""
        k = len(self.right) // (1 + self.tilted)
        return Columns(gram=self.gram[:k, :k], right=self.right[:k], tilted=False)

    def shrunk(self) -> tuple[Field, float, float]:
        """Coefficients shrunk by their own noise (k,), the nats they gain, and the evidence's.

        The evidence has the coefficients integrated over: what it gains pays for all of them.
        """
        blocks = np.split(np.arange(len(self.right)), 1 + self.tilted)
        true = [likely_variance(self.gram[np.ix_(b, b)], self.right[b]) for b in blocks]

        def cost(log_variances: Field) -> float:
            size = np.repeat(np.exp(0.5 * log_variances), len(blocks[0]))
            grown = np.eye(size.size) + size[:, None] * self.gram * size
            factor, power = cho_factor(grown, lower=True), size * self.right
            half = np.log(np.diag(factor[0])).sum()
            return float(half - 0.5 * power @ cho_solve(factor, power))

        start = np.log(true)
        least, variances = cost(start), start
        if self.tilted:
            found = minimize(cost, start, method="Nelder-Mead", options=SEARCHED)
            least, variances = float(found.fun), np.asarray(found.x)
        inverse = np.repeat(np.exp(-variances), len(blocks[0]))
        values = np.asarray(
            np.linalg.solve(self.gram + np.diag(inverse), self.right), np.float64
        )
        gain = float(values @ self.right - 0.5 * values @ self.gram @ values)
        return values, gain, -least


def likely_variance(gram: Field, right: Field) -> float:
    """Most likely variance of coefficients: along an axis of `gram` g, right ~ N(0, g + g² t)."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-6 * values.max()
    if not kept.any():
        return 1.0  # nothing was measured: any variance leaves the coefficients at zero
    values, power = values[kept], (vectors.T @ right)[kept] ** 2 / values[kept]

    def cost(log_variance: float) -> float:
        grown = np.exp(log_variance) * values
        return float((np.log1p(grown) - power * grown / (1 + grown)).sum())

    middle = -float(np.log(values.mean()))
    found = minimize_scalar(cost, bounds=(middle - 7, middle + 14), method="bounded")
    return float(np.exp(found.x))


def column_equations(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    masks: Sequence[Mask],
    *,
    tilted: bool = False,
) -> Columns:
    """Collect the columns' normal equations over all recordings.

    Parameters
    ----------
    tilted : ask for slopes as well
    """
    m = patches[0].shape[1]
    group = max(1, -(-m // SETTINGS.most_columns))
    count = -(-m // group)
    total = count * (1 + tilted)
    gram = np.zeros((total, total))
    right: Field | float = 0.0
    cross: dict[int, Field] = {}
    pose: dict[int, Field] = {}
    pose_right: dict[int, Field] = {}
    for patch, state, mask in zip(patches, states, masks, strict=True):
        pick = mask & state.used
        rows, columns = np.nonzero(pick)
        values = np.clip(state.innovations[rows, columns], -SETTINGS.clip, SETTINGS.clip)
        owner_of = np.arange(m) // group
        # the one group of each phase within reach of the innovation
        reach = owner_of[np.clip(columns[:, None] + np.arange(-3, 3)[None], 0, m - 1)]
        weight, owner = [], []
        for first, field in enumerate(_fields(patch, tilted=tilted)):
            for phase in range(COMB):
                hit = reach % COMB == phase
                near = reach[np.arange(len(rows)), hit.argmax(axis=1)]
                teeth = np.where(owner_of % COMB == phase, field, 0.0)
                weight.append(state.whiten(teeth)[rows, columns])
                owner.append(np.where(hit.any(axis=1), first * count + near, 0))
        matrix = weights_matrix(np.stack(owner, axis=1), np.stack(weight, axis=1), total)
        whitened_columns = state.columns[rows, columns].astype(np.float64)
        gram += (matrix @ matrix.T).toarray()
        right = right + matrix @ values
        r = patch.recording
        cross[r] = cross.get(r, 0.0) + matrix @ whitened_columns
        pose[r] = (
            pose.get(r, np.eye(whitened_columns.shape[1])) + whitened_columns.T @ whitened_columns
        )
        pose_right[r] = pose_right.get(r, 0.0) + whitened_columns.T @ values
    for r in cross:
        solved = np.linalg.solve(pose[r], cross[r].T)
        gram -= cross[r] @ solved
        right = right - solved.T @ pose_right[r]
    return Columns(gram=gram, right=np.asarray(right), tilted=tilted)


def _fields(patch: Patch, *, tilted: bool) -> list[Field]:
    """Return what an offset and a slope of all columns do to the readings, (n, m)."""
    fields = [np.ones(patch.shape)]
    if tilted:
        away = patch.view.depth_mm - patch.view.datasheet.working_distance_mm
        fields.append(np.where(np.isfinite(away), away, 0.0))
    return fields


def weights_matrix(owners: Field, values: Field, rows: int) -> csr_matrix:
    """Sparse (rows, N): each innovation's weight in the sums of the rows it touches."""
    count, reach = owners.shape
    columns = np.repeat(np.arange(count), reach)
    return csr_matrix((values.ravel(), (owners.ravel(), columns)), shape=(rows, count))
