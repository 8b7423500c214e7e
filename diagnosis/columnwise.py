"""Whole columns: fixed offsets of the profile's columns, the same in every recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from diagnosis.noise import Field, Mask
from diagnosis.patch import Patch
from diagnosis.rowwise import weights_matrix
from diagnosis.score import CLIP, Whitened

COMB = 6
"""An innovation sees columns from three before to two after: columns six apart never meet."""
MOST = 512


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Columns:
    """Normal equations of the columns' offsets (mm), the pose projected out.

    Attributes
    ----------
    gram : (k, k); right : (k,) or (k, draws)
    groups : how many columns share an offset
    """

    gram: Field
    right: Field
    groups: int

    def chi_square(self) -> tuple[Field, int]:
        """Square of the offsets in their noise, () or (draws,), and its degrees of freedom."""
        half, dof = _half(self.gram)
        return np.asarray(((half.T @ self.right) ** 2).sum(axis=0)), dof

    def offsets(self) -> tuple[Field, float]:
        """Offsets shrunk by their own noise, (k,) mm, and the nats they gain."""
        true = likely_variance(self.gram, self.right)
        shrunk = np.linalg.solve(self.gram + np.eye(len(self.right)) / true, self.right)
        gain = float(shrunk @ self.right - 0.5 * shrunk @ self.gram @ shrunk)
        return shrunk, gain


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
    innovations: Sequence[Field] | None = None,
) -> Columns:
    """Collect the columns' normal equations over all recordings.

    Parameters
    ----------
    innovations : for each patch (N,) or (N, draws) at its picked readings, drawn nulls
    """
    m = patches[0].shape[1]
    group = max(1, -(-m // MOST))
    count = -(-m // group)
    gram = np.zeros((count, count))
    right: Field | float = 0.0
    cross: dict[int, Field] = {}
    pose: dict[int, Field] = {}
    pose_right: dict[int, Field] = {}
    for k, (patch, state, mask) in enumerate(zip(patches, states, masks, strict=True)):
        pick = mask & state.used
        rows, columns = np.nonzero(pick)
        if innovations is None:
            values = np.clip(state.innovations[rows, columns], -CLIP, CLIP)
        else:
            values = innovations[k]
        owner_of = np.arange(m) // group
        combs, owners = [], []
        for phase in range(COMB):
            teeth = owner_of % COMB == phase
            field = state.whiten(np.broadcast_to(teeth[None, :].astype(float), patch.shape))
            combs.append(field[rows, columns])
            # the one group of this phase within reach of the innovation
            reach = owner_of[np.clip(columns[:, None] + np.arange(-3, 3)[None], 0, m - 1)]
            hit = reach % COMB == phase
            owners.append(
                np.where(hit.any(axis=1), reach[np.arange(len(rows)), hit.argmax(axis=1)], 0)
            )
        weight = np.stack(combs, axis=1)
        owner = np.stack(owners, axis=1)
        matrix = weights_matrix(owner, weight, count)
        whitened_columns = state.columns[rows, columns]
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
    return Columns(gram=gram, right=np.asarray(right), groups=group)


def _half(gram: Field) -> tuple[Field, int]:
    size = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    kept = values > 1e-3
    return (vectors[:, kept] / np.sqrt(values[kept])) / size[:, None], int(kept.sum())
