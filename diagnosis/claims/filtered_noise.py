"""Evidence that noise went through a filter along the line, along the travel, or along both.

A filter takes away fast waves and leaves slow ones. Over the noise of before, the spectrum's
logarithm of recording k, in octaves of both frequencies, is

    r_k = 2 (g_x(f_x) + g_y(f_y)) + u_k + e_k + ε_k,

g a filter's gain, a random walk over octaves that starts at nothing and goes down; u what otherwise
changes, smooth over octaves, and e any other; ε what the readings leave open (a power of N φ / 2
waves, φ its share of the frequencies, has the relative variance 2 / N φ). What a mismatch of the
mean leaves is in u and e, and so is a material's change: half of their variance is each
recording's own, half is common to all, as are the part and the sensor. A median has no gain: it
moves power from one wave to another, and on a slope it averages along level lines. What known
filters make of each recording has half of the probability. Without a filter

    r_k = 2 a + h(f) + u_k + e_k + ε_k,

a another size of a finish and h another grain of it, the same in all directions. Nobody knows the
sizes of u, e, a and h: the odds are averaged over them.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import expit, log_ndtr, logsumexp

from diagnosis.claims.noise_spectrum import GRID, power_of
from diagnosis.evidence.mean_causes import Scales
from diagnosis.fields import Field
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS

FILTER = "spectrum: filter"
"""Name of the sizes of a filter that the noise of good instruments seems to have passed."""
OCTAVES = np.array([1 / 32, 1 / 16, 1 / 8, 1 / 4])
"""Lower ends of the octaves of frequencies, per pitch; the last one ends at the sampling's limit.
Slower waves are what smooth causes leave of the mean."""
USED = np.arange(1, OCTAVES.size**2)
"""Pairs of octaves that are compared: so are the slowest waves along both axes."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FilterWeighed:
    """A filter against none.

    Attributes
    ----------
    free : (S,) log Bayes factor of gains of each size, the root mean square of the noise's
        logarithm
    law : (S,) the same of the known filters of about that size; of gains where there is none
    known : (L,) log Bayes factor of each known filter
    """

    free: Field
    law: Field
    known: Field

    @property
    def factors(self) -> Field:
        """Log Bayes factor of each size, (S,)."""
        return _mean([self.free, self.law])

    def nats(self, good: Scales) -> float:
        """Log Bayes factor of a filter, known or of another form, against a good instrument.

        Known ones are as probable as each other, whatever their sizes.

        Parameters
        ----------
        good : sizes that good instruments seem to have
        """
        by_form = np.array([good.of_change(FILTER, self.free), _mean(self.known)])
        return float(_mean(by_form)) - good.of_good(FILTER, self.factors)

    @property
    def unknown(self) -> float:
        """Probability that a filter is none of the known ones."""
        return float(expit(_mean(self.free) - _mean(self.known)))


def weighed(
    now: Sequence[NoiseModel], before: Sequence[NoiseModel], changes: Field
) -> FilterWeighed:
    """Weigh whether noise went through a filter.

    Parameters
    ----------
    now, before : noise of recordings, and of plates, baselines or a surface's file; in one unit
    changes : (L, R, K) of the spectrum's logarithm by known filters, see `log_octaves`
    """
    sizes, other = SETTINGS.mean_sizes(), np.append(0.0, SETTINGS.claims.spectrum_changes())
    was = [n.readings for n in before]
    usual = np.log(np.average(np.exp([log_octaves(n) for n in before]), axis=0, weights=was))
    ratio = np.stack([log_octaves(n) for n in now]) - usual
    errors = [
        _Errors.of([n.readings for n in now], sum(was), u, e)
        for u, e in itertools.product(other, other)
    ]
    x, y = _places()
    grain = _smooth(0.5 * np.log2(4.0**x + 4.0**y))
    finishes = [np.square(2 * a) + np.square(2 * h) * grain for a in other for h in other]
    seen = [(one, one.together(ratio)) for one in errors]
    none = _mean([one.log_density(mean, c) for one, mean in seen for c in finishes])
    known = _mean([one.log_density(one.together(ratio - changes)) for one in errors]) - none
    gains = [np.square(2 * s) * np.stack(_walks()) for s in sizes]
    free = np.array([
        _mean([one.log_lower(mean, k) for one, mean in seen for k in each]) for each in gains
    ]) - none  # fmt: skip
    size = 0.5 * np.sqrt(np.square(changes).mean(axis=(1, 2)))
    at = np.abs(np.log(np.maximum(size[:, None], sizes[0]) / sizes)).argmin(axis=1)
    law = [_mean(known[at == k]) if (at == k).any() else one for k, one in enumerate(free)]
    return FilterWeighed(free=free, law=np.array(law), known=known)


def log_octaves(noise: NoiseModel) -> Field:
    """Logarithm of the mean power in pairs of octaves, the travel's frequency and the line's, (K,).

    In the square of the unit of its `sd_mm`.
    """
    members = _members()
    number = members.sum(axis=1)
    power = members @ np.maximum(power_of(noise.acf), 0.0) @ members.T / np.outer(number, number)
    return np.asarray(np.log(noise.sd_mm**2 * (power.ravel()[USED] + LEAKING)))


LEAKING = 0.01
"""Power in an octave, over the mean of all, that leaks from others: no filter takes it away."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Errors:
    """Errors of spectra of R recordings over one of before, given the sizes of u and e.

    As a function of what they have in common, the density of several recordings is that of their
    weighted mean. Each recording's own changes and those common to all are as large.

    Attributes
    ----------
    precision : (R, K, K) of each recording's own errors
    mean : (K, K) covariance of the weighted mean's
    common : (K, K) of those of before, and of what all recordings change by
    """

    precision: Field
    mean: Field
    common: Field

    @classmethod
    def of(cls, now: Sequence[int], before: int, u: float, e: float) -> "_Errors":
        """Return the errors of spectra of so many readings."""
        other = np.square(2 * u) * _smooth(*_places()) + np.square(2 * e) * np.eye(USED.size)
        own = np.stack([np.diag(2 / max(n, 1) / _shares()) + other for n in now])
        precision = np.linalg.inv(own)
        return cls(
            precision=precision, mean=np.linalg.inv(precision.sum(axis=0)),
            common=np.diag(2 / max(before, 1) / _shares()) + other,
        )

    def together(self, rest: Field) -> "_Together":
        """Weigh what changes (..., R, K) leave of the recordings."""
        mean = np.einsum("rkl,...rl->...k", self.precision, rest) @ self.mean
        away = rest - mean[..., None, :]
        square = np.einsum("...rk,rkl,...rl->...", away, self.precision, away, optimize=True)
        scale = np.linalg.slogdet(self.mean)[1] + np.linalg.slogdet(self.precision)[1].sum()
        return _Together(mean=mean, log=np.asarray(0.5 * (scale - square)))

    def log_density(self, seen: "_Together", common: Field | float = 0.0) -> Field:
        """Log density, where all recordings have another change by a covariance."""
        factor = cho_factor(self.mean + self.common + common, lower=True)
        square = (seen.mean * cho_solve(factor, seen.mean.T).T).sum(axis=-1)
        return np.asarray(seen.log - 0.5 * square - np.log(np.diag(factor[0])).sum())

    def log_lower(self, seen: "_Together", signal: Field) -> float:
        """Log density where all have a signal by a covariance that goes down: its mean below 0."""
        factor = cho_factor(self.mean + self.common + signal, lower=True)
        along = signal.mean(axis=0)
        solved = cho_solve(factor, np.stack([seen.mean, along], axis=1))
        variance = max(signal.mean() - float(along @ solved[:, 1]), 1e-12 * signal.mean())
        down = log_ndtr(-float(along @ solved[:, 0]) / np.sqrt(variance))
        return float(self.log_density(seen, signal) + np.log(2) + down)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Together:
    """Recordings as one.

    Attributes
    ----------
    mean : (..., K) weighted
    log : (...) log density of what recordings are apart by
    """

    mean: Field
    log: Field


def _members() -> Field:
    """Which frequencies belong to which octave, (4, GRID)."""
    octave = np.searchsorted(OCTAVES, np.abs(np.fft.fftfreq(GRID)), side="right") - 1
    return np.asarray(octave == np.arange(OCTAVES.size)[:, None], dtype=np.float64)


def _shares() -> Field:
    """Share of all frequencies in each pair of octaves that is compared, (K,)."""
    share = _members().mean(axis=1)
    return np.asarray(np.outer(share, share).ravel()[USED])


def _places() -> tuple[Field, Field]:
    """Return the number of the octave of the line's and of the travel's frequency, (K,)."""
    y, x = np.divmod(USED, OCTAVES.size)
    return x.astype(np.float64), y.astype(np.float64)


def _walks() -> tuple[Field, Field, Field]:
    """Covariances of a gain's logarithm of mean square 1: the line's, the travel's, both's."""
    across, along = (_walk(places + 1) for places in _places())
    return across, along, (across + along) / 2


def _walk(steps: Field) -> Field:
    """Covariance of a random walk after so many steps, of mean square 1."""
    return np.asarray(np.minimum.outer(steps, steps) / steps.mean())


def _smooth(*places: Field) -> Field:
    """Covariance of what is smooth over octaves."""
    square = sum(np.square(np.subtract.outer(p, p)) for p in places)
    return np.asarray(np.exp(-0.5 * square), dtype=np.float64)


def _mean(logs: Sequence[float] | Sequence[Field] | Field) -> Field:
    """Logarithm of a mean over the first axis."""
    return np.asarray(logsumexp(np.asarray(logs), axis=0) - np.log(len(logs)))
