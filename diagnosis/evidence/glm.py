"""Evidence in the scale, missing and outlier channels: generalised linear models by Laplace.

Scale: a whitened reading e has log density -h - e² exp(-2h) / 2, h the change of the noise's
logarithm. Missing and outliers: rare events are Poisson, with log density k η - μ exp(η), μ the
share expected. Sums over cells of readings with one predictor are sufficient for both. Coefficients
have Gaussian priors, and

    ln p(y | s) ≈ l(β̂) - ½ |β̂|²/s² - ½ ln |I + s² X'HX|

(Tierney and Kadane, J. Am. Stat. Assoc. 81 (1986) 82). Events come in clusters and squares are
heavy-tailed: log likelihoods are divided by the measured dispersion (quasi-likelihood, Wedderburn,
Biometrika 61 (1974) 439).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack

Floats = NDArray[np.float64]
Owners = NDArray[np.int64]
STEPS = 40
SETTLED = 1e-5
LEAST_STEP = 1e-3
SPARSE = 0.1
"""Share of entries that aren't zero below which columns are kept as a sparse matrix."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Responses:
    """Readings, or cells of them with one predictor.

    Attributes
    ----------
    kind : scale or rate
    seen : (N,) squares of whitened readings, or events
    usual : (N,) number of readings, or events expected
    dispersion : by which log likelihoods are divided
    """

    kind: Literal["scale", "rate"]
    seen: Floats
    usual: Floats
    dispersion: float

    def information(self) -> float:
        """Return the curvature of the log likelihood by a change of the level."""
        return float(self.likelihood(np.zeros(self.seen.size))[2].sum())

    def moved(self, change: Floats) -> "Responses":
        """Return the same where the predictor is changed already."""
        if self.kind == "scale":
            return replace(self, seen=self.seen * np.exp(-2 * change))
        return replace(self, usual=self.usual * np.exp(change))

    def in_cells(self, owner: Owners, count: int) -> "Responses":
        """Sum over cells; exact where the predictor is the same throughout a cell."""
        return replace(
            self, seen=np.bincount(owner, self.seen, count).astype(np.float64),
            usual=np.bincount(owner, self.usual, count).astype(np.float64),
        )  # fmt: skip

    def likelihood(self, eta: Floats) -> tuple[float, Floats, Floats]:
        """Log likelihood at a predictor, its slope and its curvature, (N,)."""
        if self.kind == "scale":
            part = self.seen * np.exp(-2 * eta)
            value, slope, curve = -self.usual * eta - 0.5 * part, part - self.usual, 2 * part
        else:
            part = self.usual * np.exp(eta)
            value, slope, curve = self.seen * eta - part, self.seen - part, part
        d = self.dispersion
        return float(value.sum()) / d, slope / d, curve / d


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Mode:
    """Most probable coefficients, and the log evidence there.

    Attributes
    ----------
    root : (k, k) R of the covariance R R' of the coefficients
    """

    coefficients: Floats
    root: Floats
    log_evidence: float

    @property
    def sd(self) -> Floats:
        """Standard deviations of the coefficients."""
        return np.asarray(np.sqrt(np.square(self.root).sum(axis=1)))


def mode(responses: Responses, columns: Floats, sd: Floats, start: Floats | None = None) -> Mode:
    """Find the posterior's mode by damped Newton steps.

    Parameters
    ----------
    columns : (N, k)
    sd : (k,) of the coefficients before any reading
    start : (k,) where to begin
    """
    scaled = columns * sd
    if np.count_nonzero(scaled) < SPARSE * scaled.size:
        scaled = sparse.csr_array(scaled)
    u = np.zeros(len(sd)) if start is None else start / sd
    best, slope, curve = responses.likelihood(scaled @ u)
    best -= 0.5 * float(u @ u)
    for _ in range(STEPS):
        step, _ = lapack.dpotrs(_factor(scaled, curve), scaled.T @ slope - u, lower=1)
        step *= min(1.0, 2.0 / max(np.abs(scaled @ step).max(initial=0.0), 1e-12))
        size, before = 1.0, best
        while size > LEAST_STEP:
            there = u + size * step
            value, slope, curve = responses.likelihood(scaled @ there)
            value -= 0.5 * float(there @ there)
            if value >= best:
                u, best = there, value
                break
            size *= 0.5
        else:
            break
        if best - before < SETTLED:
            break
    _, _, curve = responses.likelihood(scaled @ u)
    root = _factor(scaled, curve)
    half, _ = lapack.dtrtri(root, lower=1)
    return Mode(
        coefficients=sd * u, root=sd[:, None] * half.T,
        log_evidence=best - float(np.log(np.diag(root)).sum()),
    )  # fmt: skip


def _factor(columns: Floats | sparse.csr_array, curve: Floats) -> Floats:
    """Lower Cholesky factor of the precision I + X'HX; zeros above its diagonal.

    LAPACK is called by itself: the matrices are small, and there are thousands of them.

    Raises
    ------
    LinAlgError
        Where the precision isn't positive: curvatures that aren't finite.
    """
    if isinstance(columns, np.ndarray):
        inner = (columns * curve[:, None]).T @ columns
    else:
        inner = (columns.multiply(curve[:, None]).T @ columns).toarray()
    inner[np.diag_indices_from(inner)] += 1.0
    root, failed = lapack.dpotrf(inner, lower=1, clean=1)
    if failed:
        raise np.linalg.LinAlgError("the precision of a rate's coefficients isn't positive")
    return np.asarray(root)
