"""Evidence in the scale, missing and outlier channels: generalised linear models by Laplace.

Scale: a whitened reading e has log density -η - e² exp(-2η) / 2, η the change of the noise's
logarithm. Missing and outliers: rare events are Poisson, and what counts is how many there are:

    √p = √p₀ + η / 2,

p₀ the share expected. The root is what steadies a Poisson count's variance (Bartlett, Suppl. J. R.
Stat. Soc. 3 (1936) 68), so that η is in deviations of the chance of one reading, as whitened depths
are: an instrument that loses two readings for one in 10⁵ is nearly as good as before, one that
loses a fifth of all isn't, and the logarithms of both may have changed alike. Sums over cells of
readings with one predictor are sufficient. Coefficients have Gaussian priors, and

    ln p(y | s) ≈ l(β̂) - ½ |β̂|²/s² - ½ ln |I + s² X'HX|

(Tierney and Kadane, J. Am. Stat. Assoc. 81 (1986) 82). Events come in clusters and squares are
heavy-tailed: log likelihoods are divided by the measured dispersion (quasi-likelihood, Wedderburn,
Biometrika 61 (1974) 439).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack

Floats = NDArray[np.float64]
Owners = NDArray[np.int64]
STEPS = 40
SETTLED = 1e-5
LEAST_STEP = 1e-3
LEAST_SHARE = 1e-6
"""Share of events that is expected anywhere: one in a million."""
SPARSE = 0.1
"""Share of entries that aren't zero below which columns are kept as a sparse matrix."""


class Likelihood(Protocol):
    """Log likelihood of readings one by one, or of cells of readings with one predictor each."""

    def likelihood(self, eta: Floats) -> tuple[float, Floats, Floats]:
        """Log likelihood at a predictor, its slope and its curvature, (N,)."""


class Responses(Likelihood, Protocol):
    """What readings show of a channel."""

    @property
    def dispersion(self) -> float:
        """By which log likelihoods are divided."""

    @property
    def seen(self) -> Floats:
        """Squares of whitened readings, or events, (N,)."""

    def information(self) -> float:
        """Return the curvature of the log likelihood by a change of the level."""

    def moved(self, change: Floats) -> "Responses":
        """Return the same readings where the predictor is changed already."""

    def clumped(self, dispersion: float) -> "Responses":
        """Return the same readings with another dispersion."""

    def beside(self, usual: "Responses") -> "Responses":
        """Expect of readings what those of baselines show, where no law says more."""

    def in_cells(self, owner: Owners, count: int) -> Likelihood:
        """Sum over cells; exact where the predictor is the same throughout a cell."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Squares:
    """Squares of whitened readings; see `Responses`.

    Attributes
    ----------
    number : (N,) of readings
    """

    seen: Floats
    number: Floats
    dispersion: float = 1.0

    def information(self) -> float:
        """Return the curvature of the log likelihood by a change of the level."""
        return float(2 * self.seen.sum()) / self.dispersion

    def moved(self, change: Floats) -> "Squares":
        """Return the same readings where the predictor is changed already."""
        return replace(self, seen=self.seen * np.exp(-2 * change))

    def clumped(self, dispersion: float) -> "Squares":
        """Return the same readings with another dispersion."""
        return replace(self, dispersion=dispersion)

    def beside(self, usual: Responses) -> "Squares":
        """Return them as they are: noise is free in its level."""
        return self

    def in_cells(self, owner: Owners, count: int) -> "Squares":
        """Sum over cells."""
        seen, number = (_sums(x, owner, count) for x in (self.seen, self.number))
        return replace(self, seen=seen, number=number)

    def likelihood(self, eta: Floats) -> tuple[float, Floats, Floats]:
        """Log likelihood at a predictor, its slope and its curvature, (N,)."""
        part, d = self.seen * np.exp(-2 * eta), self.dispersion
        value = -self.number * eta - 0.5 * part
        return float(value.sum()) / d, (part - self.number) / d, 2 * part / d


@dataclass(frozen=True, kw_only=True, eq=False)
class Events:
    """Lost readings, or outliers, of readings one by one; see `Responses`.

    Attributes
    ----------
    seen : (N,) 1 for an event
    usual : (N,) share expected
    noise : share that passes for noise, which is expected where no law says more
    """

    seen: Floats
    usual: Floats
    noise: float = 0.0
    dispersion: float = 1.0

    @cached_property
    def root(self) -> Floats:
        """Root of the share expected; no reading is certain."""
        return np.sqrt(np.maximum(self.usual, LEAST_SHARE))

    def information(self) -> float:
        """Return the curvature of the log likelihood by a change of the level."""
        return self.seen.size / self.dispersion

    def moved(self, change: Floats) -> "Events":
        """Return the same readings where the predictor is changed already."""
        return replace(self, usual=np.square(np.maximum(self.root + change / 2, 0.0)))

    def clumped(self, dispersion: float) -> "Events":
        """Return the same readings with another dispersion."""
        return replace(self, dispersion=dispersion)

    def beside(self, usual: Responses) -> "Events":
        """Expect no more events than baselines have, where no law says more."""
        assert isinstance(usual, Events)
        share = min(self.noise, usual.noise)
        return replace(
            self, usual=np.where(self.usual <= self.noise, share, self.usual), noise=share
        )

    def in_cells(self, owner: Owners, count: int) -> "EventsInCells":
        """Sum over cells."""
        of = (self.seen, np.square(self.root), self.root, np.ones_like(self.root))
        seen, usual, roots, number = (_sums(x, owner, count) for x in of)
        at_events = _sums(self.seen * self.root, owner, count) / np.maximum(seen, 1.0)
        return EventsInCells(
            seen=seen, usual=usual, roots=roots, number=number, at_events=at_events,
            dispersion=self.dispersion,
        )  # fmt: skip

    def likelihood(self, eta: Floats) -> tuple[float, Floats, Floats]:
        """Log likelihood at a predictor, its slope and its curvature, (N,)."""
        return self.in_cells(np.arange(self.seen.size), self.seen.size).likelihood(eta)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class EventsInCells:
    """Sums of events over cells.

    Attributes
    ----------
    seen, usual : (N,) events, and events expected
    roots : (N,) sum of the roots of the shares expected
    number : (N,) of readings
    at_events : (N,) mean root of the share expected where events are
    """

    seen: Floats
    usual: Floats
    roots: Floats
    number: Floats
    at_events: Floats
    dispersion: float

    def likelihood(self, eta: Floats) -> tuple[float, Floats, Floats]:
        """Log likelihood at a predictor, its slope and its curvature, (N,).

        No share's root is below zero where there are events.
        """
        some, d = self.seen > 0, self.dispersion
        root = np.where(some, self.at_events + eta / 2, 1.0)
        if (root <= 0).any():
            return -np.inf, np.zeros_like(eta), np.ones_like(eta)
        expected = self.usual + eta * self.roots + np.square(eta) * self.number / 4
        value = 2 * self.seen * np.log(root) - expected
        slope = self.seen / root - self.roots - eta * self.number / 2
        curve = self.seen / np.square(root) / 2 + self.number / 2
        return float(value.sum()) / d, slope / d, curve / d


def _sums(values: Floats, owner: Owners, count: int) -> Floats:
    return np.bincount(owner, values, count).astype(np.float64)


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


def mode(responses: Likelihood, columns: Floats, sd: Floats, start: Floats | None = None) -> Mode:
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
