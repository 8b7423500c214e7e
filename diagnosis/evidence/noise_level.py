"""Evidence for a change of the noise's level against plates, baselines or a claimed surface.

The change of the noise's logarithm is measured as one number (`known_size.py`), and a good
instrument's part and plates differ by sizes that the population tells.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from diagnosis.evidence.known_size import factors_of_value
from diagnosis.evidence.mean_causes import Scales
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
AGAINST_PLATES = "scale: level of the noise"
"""Key of the population's sizes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LevelChange:
    """How much larger a part's noise is than a nominal one.

    Attributes
    ----------
    log : logarithm of the ratio
    unsure : its standard deviation, by the readings that it was measured on
    """

    log: float
    unsure: float


def level_factors(change: float, unsure: float) -> Floats:
    """Log Bayes factor of each size of a change, (S,)."""
    return factors_of_value(change, unsure, SETTINGS.rate_sizes())


def level_nats(change: LevelChange, usual: Mapping[str, Floats]) -> float:
    """Log Bayes factor that the level changed, against a good instrument.

    Parameters
    ----------
    usual : probability of each component's sizes in a good instrument
    """
    scales = Scales(sizes=SETTINGS.rate_sizes(), weights=usual)
    return scales.nats(AGAINST_PLATES, level_factors(change.log, change.unsure))


def claimed_sizes() -> dict[str, Floats]:
    """Probability of each size by which a surface's noise is off what a file claims.

    Half a normal distribution; a step of the grid is as wide as its size.
    """
    sizes = SETTINGS.rate_sizes()
    weights = sizes * np.exp(-0.5 * np.square(sizes / SETTINGS.claimed_level))
    return {AGAINST_PLATES: weights / weights.sum()}


def steady_level(changes: Sequence[LevelChange], usual: Floats) -> dict[str, Floats]:
    """Probability of each size by which a part's noise changes from one recording to another.

    Told by baselines, whose changes h scatter by s about a mean h̄ that may be any: with w = σ² + s²

        2 ln p(s) = -Σ ln w - Σ (h - h̄)² / w - ln Σ 1/w.

    Parameters
    ----------
    changes : of each baseline, against all of them
    usual : probability of each size in good instruments that were seen; as likely it is unlike them
        and any size as probable as another
    """
    none = np.zeros(len(changes))
    nats = np.array([_log_likelihood(changes, s, none) for s in SETTINGS.rate_sizes()])
    weights = np.exp(nats - nats.max()) * (usual + 1 / usual.size)
    return {AGAINST_PLATES: weights / weights.sum()}


def nats_since(
    seen: Sequence[LevelChange], good: Sequence[LevelChange], usual: Mapping[str, Floats],
    doubt: float = 0.0,
) -> float:  # fmt: skip
    """Log Bayes factor that the level changed since baselines were recorded.

    Recordings and baselines scatter by the same s about a mean that may be any; recordings may have
    changed by c together.

    Parameters
    ----------
    seen, good : of recordings and of baselines, against the same noise
    usual : probability of each size s, given the baselines
    doubt : standard deviation by which recordings differ together for another reason
    """
    scales = Scales(sizes=SETTINGS.rate_sizes(), weights=usual)
    every = [*seen, *good]
    now = (np.arange(len(every)) < len(seen)).astype(float)
    quiet, found = [], []
    for s, weight in zip(scales.sizes, scales.of(AGAINST_PLATES), strict=True):
        known = math.log(max(weight, 1e-300)) - _log_likelihood(good, s, np.zeros(len(good)))
        quiet.append(known + _log_likelihood(every, s, doubt * now))
        for c, share in zip(scales.sizes, scales.changed(AGAINST_PLATES), strict=True):
            both = math.hypot(c, doubt)
            found.append(known + math.log(share) + _log_likelihood(every, s, both * now))
    return float(logsumexp(found) - logsumexp(quiet))


def _log_likelihood(changes: Sequence[LevelChange], scatter: float, shared: Floats) -> float:
    """Log likelihood of changes about a mean that may be any, but for a constant.

    Parameters
    ----------
    scatter : standard deviation of each, beside what readings leave open
    shared : (R,) deviation that all have together
    """
    log, unsure = (np.array([getattr(c, k) for c in changes]) for k in ("log", "unsure"))
    covariance = np.diag(np.square(unsure) + scatter**2) + np.outer(shared, shared)
    inverse = np.linalg.inv(covariance)
    total = inverse.sum(axis=0)
    inverse -= np.outer(total, total) / total.sum()
    volume = np.linalg.slogdet(covariance)[1] + math.log(total.sum())
    return -0.5 * float(volume + log @ inverse @ log)


def scatter_of(changes: Sequence[LevelChange]) -> float:
    """Estimate the standard deviation of changes beside what their readings leave open.

    By moments (DerSimonian & Laird, Control. Clin. Trials 7 (1986) 177): with weights w = 1 / σ²,

        s² = (Σ w (h - h̄)² - (n - 1)) / (Σ w - Σ w² / Σ w)    at least 0
    """
    if len(changes) < 2:
        return 0.0
    log, unsure = (np.array([getattr(c, k) for c in changes]) for k in ("log", "unsure"))
    weight = unsure**-2
    spread = float((weight * np.square(log - np.average(log, weights=weight))).sum())
    free = float(weight.sum() - np.square(weight).sum() / weight.sum())
    return math.sqrt(max(spread - (len(changes) - 1), 0.0) / free)


def level_unsure(noise: NoiseModel, *, whitened: bool = False) -> float:
    """Return the standard deviation of the logarithm of a measured noise's size.

    The mean square of a stationary Gaussian field has the relative variance 2 Σρ² / N, ρ its
    autocorrelation (Priestley, Spectral Analysis, 1981, § 5.3).

    Parameters
    ----------
    whitened : whether the size was measured on whitened readings, which have none
    """
    together = 1.0 if whitened else float(np.square(noise.acf).sum())
    return 0.5 * math.sqrt(2.0 * together / max(noise.readings, 1))
