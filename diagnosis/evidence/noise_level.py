"""Evidence for a change of the noise's level against plates, baselines or a claimed surface.

The change h of the noise's logarithm is measured with a deviation σ. Where it has the size s,

    ln BF(s) = ln N(h; 0, σ² + s²) - ln N(h; 0, σ²)

and a good instrument's part and plates differ by sizes that the population tells.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from diagnosis.evidence.mean_causes import Scales
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
AGAINST_PLATES = "scale: level of the noise"
"""Key of the population's sizes."""


def level_factors(change: float, unsure: float) -> Floats:
    """Log Bayes factor of each size of a change, (S,)."""
    wide = unsure**2 + np.square(SETTINGS.rate_sizes())
    return np.asarray(0.5 * (change**2 * (unsure**-2 - 1 / wide) - np.log(wide / unsure**2)))


def level_odds(change: float, unsure: float, usual: Mapping[str, Floats]) -> float:
    """Log odds that the level changed, against a good instrument.

    Parameters
    ----------
    change : of the noise's logarithm
    unsure : its standard deviation
    usual : probability of each component's sizes in a good instrument
    """
    scales = Scales(sizes=SETTINGS.rate_sizes(), weights=usual)
    factors = level_factors(change, unsure)
    quiet = np.log(np.maximum(scales.of(AGAINST_PLATES), 1e-300))
    found = logsumexp(factors + np.log(scales.changed(AGAINST_PLATES)))
    return float(found - logsumexp(factors + quiet)) + SETTINGS.log_odds(AGAINST_PLATES)


def claimed_sizes() -> dict[str, Floats]:
    """Probability of each size by which a surface's noise is off what a file claims."""
    weights = np.exp(-0.5 * np.square(SETTINGS.rate_sizes() / SETTINGS.claimed_level))
    return {AGAINST_PLATES: weights / weights.sum()}


def unchanged_level() -> dict[str, Floats]:
    """Probability of each size by which a part's noise is off that in baselines of the part."""
    weights = np.zeros(len(SETTINGS.rate_sizes()))
    weights[0] = 1.0
    return {AGAINST_PLATES: weights}


def level_unsure(noise: NoiseModel) -> float:
    """Return the standard deviation of the logarithm of a measured noise's size.

    The mean square of a stationary Gaussian field has the relative variance 2 Σρ² / N, ρ its
    autocorrelation (Priestley, Spectral Analysis, 1981, § 5.3).
    """
    together = float(np.square(noise.acf).sum())
    return 0.5 * math.sqrt(2.0 * together / max(noise.readings, 1))
