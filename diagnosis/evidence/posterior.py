"""Marginal likelihoods of components whose coefficients are Gaussian.

Unknown are the discrepancy b of a good instrument, b_c ~ N(0, δ_c²), shared by baselines and
recordings, and the change Δ_a ~ N(0, s_a²) of each active term a, in the recordings alone:

    y_baseline = X b + ε,    y = X b + X_a Δ_a + ε,    ε ~ N(0, I)

With A the posterior precision of (b, Δ), everything that a further term c could add is

    Λ = G_cc - G_c· A⁻¹ G_·c,     η = g_c - G_c· A⁻¹ g,

    ln BF(s) = -½ ln |I + s²Λ| + ½ η' (s⁻² I + Λ)⁻¹ η

(MacKay, Neural Comp. 4 (1992) 415; Wood, Generalized Additive Models, 2017, §6.2).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.linalg import lapack

from diagnosis.evidence.block_diagonal import BlockDiagonal

Floats = NDArray[np.float64]
Weights = Floats | BlockDiagonal
ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Equations:
    """Normal equations G = X'X and g = X'y of M columns."""

    matrix: Floats
    right: Floats


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class World:
    """Equations of one choice of readings, and of the baselines' same choice."""

    found: Equations
    baseline: Equations | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Term:
    """A component as it may change: `at` picks columns of the equations, `weights` joins them.

    Attributes
    ----------
    at : (j,) which columns
    weights : (j, k) combinations of them; None for the columns as they are
    """

    at: NDArray[np.int64]
    weights: Weights | None = None

    def of_rows(self, matrix: Floats) -> Floats:
        """Combine rows (M, ...) into (k, ...)."""
        picked = matrix[self.at]
        return np.asarray(picked if self.weights is None else self.weights.T @ picked)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Cavity:
    """Information on one term, all else integrated: Λ (k, k) and η (k,)."""

    information: Floats
    pull: Floats

    def combined(self, weights: Weights) -> "Cavity":
        """Return the information on combinations (k, l) of the term's columns."""
        half = weights.T @ self.information  # which is symmetric
        return Cavity(information=weights.T @ half.T, pull=weights.T @ self.pull)

    def log_factors(self, sizes: Floats) -> Floats:
        """Log Bayes factor of the term with variance size² against none, for each size."""
        values, vectors = np.linalg.eigh(self.information)
        return np.asarray(_log_factors(values, vectors.T @ self.pull, sizes).sum(axis=1))

    def log_factors_of_each(self, columns: Floats, sizes: Floats) -> Floats:
        """Return the same (V, S) of single combinations (k, V) of the columns, each by itself."""
        information = (columns * (self.information @ columns)).sum(axis=0)
        return _log_factors(information, columns.T @ self.pull, sizes).T

    def gain(self, size: float) -> float:
        """Return by how much its most probable value makes the readings more probable, in nats.

        Less what the value of readings that show nothing of the term would gain on average.
        """
        values, vectors = np.linalg.eigh(self.information)
        known = values > ROUNDING * values.max(initial=0.0)
        v = size**2 * values[known]
        taken = v / (1 + v)
        seen = np.square(vectors.T @ self.pull)[known] / values[known]
        return float(((taken - taken**2 / 2) * (seen - 1)).sum())

    def log_price(self, sizes: Floats) -> Floats:
        """Return the same for readings that show nothing of the term."""
        values = np.maximum(np.linalg.eigvalsh(self.information), 0.0)
        v = np.square(sizes)[:, None] * values
        return np.asarray(-0.5 * np.log1p(v).sum(axis=1))


def _log_factors(information: Floats, pull: Floats, sizes: Floats) -> Floats:
    """Log Bayes factor (S, k) of each of k directions that tell nothing of each other."""
    square = np.square(sizes)[:, None]
    v = square * np.maximum(information, 0.0)
    return np.asarray(0.5 * (square * np.square(pull) / (1 + v) - np.log1p(v)))


class Posterior:
    """Joint posterior of the discrepancy and of the active terms."""

    def __init__(
        self,
        found: Equations,
        discrepancy: Floats,
        active: Sequence[tuple[Term, float]] = (),
        baseline: Equations | None = None,
    ) -> None:
        """Factorise the posterior's precision.

        Parameters
        ----------
        found : equations of the recordings
        discrepancy : (M,) standard deviation of each coefficient of a good instrument
        active : terms with their sizes
        baseline : equations of the baselines, in the same columns
        """
        d, size = discrepancy, len(discrepancy)
        right = found.right if baseline is None else found.right + baseline.right
        rows = [s * t.of_rows(found.matrix) for t, s in active]
        changes = np.concatenate(rows) if rows else np.zeros((0, size))
        inner = [s * t.of_rows(changes.T) for t, s in active]
        between = np.concatenate(inner) if inner else np.zeros((0, 0))

        def precision() -> Floats:
            out = np.empty((size + len(changes), size + len(changes)))
            both = out[:size, :size]
            np.multiply(d[:, None], found.matrix, out=both)
            if baseline is not None:
                both += d[:, None] * baseline.matrix
            both *= d
            out[size:, :size] = changes * d
            out[:size, size:] = out[size:, :size].T
            out[size:, size:] = between
            out[np.diag_indices_from(out)] += 1.0
            return out

        pulls = [s * t.of_rows(found.right) for t, s in active]
        h = np.concatenate([d * right, *pulls])
        self._factor = _factored(precision)
        self._solved = linalg.cho_solve(self._factor, h, check_finite=False)
        self._cavities: dict[bytes, Cavity] = {}
        self._found, self._d, self._changes, self._active = found, d, changes, tuple(active)
        self.log_evidence = float(
            0.5 * h @ self._solved - np.log(np.diag(self._factor[0])).sum()
        )

    def coefficients(self) -> Floats:
        """Posterior mean of what the recordings' columns hold, discrepancy and changes, (M,)."""
        size = len(self._d)
        out = np.asarray(self._d * self._solved[:size])
        at = size
        for term, s in self._active:
            weights = np.eye(len(term.at)) if term.weights is None else term.weights
            k = weights.shape[1]
            np.add.at(out, term.at, s * (weights @ self._solved[at : at + k]))
            at += k
        return out

    def cavity(self, term: Term) -> Cavity:
        """Integrate all but one further term; several causes share their columns as they are."""
        if term.weights is not None:
            return self._cavity(term)
        key = term.at.tobytes()
        if key not in self._cavities:
            self._cavities[key] = self._cavity(term)
        return self._cavities[key]

    def _cavity(self, term: Term) -> Cavity:
        gw = term.of_rows(self._found.matrix)
        u = np.concatenate([self._d[:, None] * gw.T, term.of_rows(self._changes.T).T])
        # u' A⁻¹ u by half of a solution: with A = L L', it is v'v of v = L⁻¹ u
        v = linalg.solve_triangular(self._factor[0], u, lower=True, check_finite=False)
        information = term.of_rows(gw.T) - v.T @ v
        return Cavity(
            information=0.5 * (information + information.T),
            pull=term.of_rows(self._found.right) - u.T @ self._solved,
        )


class Posteriors(Mapping[bool, Posterior]):
    """Posteriors with the same terms, by their choice of readings; each is made when asked for."""

    def __init__(
        self,
        worlds: Mapping[bool, World],
        discrepancy: Mapping[bool, Floats],
        active: Sequence[tuple[Term, float]] = (),
    ) -> None:
        self._worlds, self._discrepancy, self._active = worlds, discrepancy, active
        self._made: dict[bool, Posterior] = {}

    def __getitem__(self, edges: bool) -> Posterior:
        """Return the posterior off edges (False), or given all readings (True)."""
        if edges not in self._made:
            world = self._worlds[edges]
            self._made[edges] = Posterior(
                world.found, self._discrepancy[edges], self._active, world.baseline
            )
        return self._made[edges]

    def __iter__(self) -> Iterator[bool]:
        """Iterate over the choices of readings."""
        return iter(self._worlds)

    def __len__(self) -> int:
        """Count the choices of readings."""
        return len(self._worlds)


def _factored(precision: Callable[[], Floats]) -> tuple[Floats, bool]:
    """Cholesky factor of a precision whose sums are good to seven digits, or to fewer.

    Parameters
    ----------
    precision : makes the matrix, which the factor takes the room of
    """
    rounding = ROUNDING
    while True:
        raised = precision()
        raised[np.diag_indices_from(raised)] *= 1 + rounding
        # it is symmetric, and LAPACK's order is the transpose's
        factor, failed = lapack.dpotrf(raised.T, lower=1, clean=0, overwrite_a=1)
        if not failed:
            return factor, True
        if rounding >= 1:
            raise linalg.LinAlgError("the precision of the mean's coefficients isn't positive")
        rounding *= 10
