"""How much more noise there is in long waves than whitening leaves.

A reading is whitened given a few neighbours. What the relief of a ground or milled surface is
correlated over reaches farther, and a smooth component takes its long waves for a signal: readings
count as too many. Beyond the causes that were found, whitened readings have the power 1 at every
frequency (white noise of unit variance); each frequency's is distributed exponentially, so that
its median is ln 2 (Priestley, Spectral Analysis, 1981, § 6.2). The median leaves alone what
oscillates at one frequency, and whole profiles and columns are left out, and where profiles were
found to slip, what a slip of each would do. By that power the equations of the mean are divided
(quasi-likelihood: Wedderburn, Biometrika 61 (1974) 439).
"""

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_level import LevelChange, level_factors
from diagnosis.fields import Field, Mask
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS
from sensors.view.covariates import COVARIATES

LONG_WAVES = "scale: long waves of the noise"
"""Key of the population's sizes: of the logarithm of their root mean square."""


def power_of_long_waves(
    ws: Workspace, model: Model, usual: Mapping[str, Field], slips: Collection[str] = ()
) -> float:
    """Return the power that the long waves of the noise have, 1 or more.

    Some of what is measured may be a mismatch. Its logarithm is the mean of the measured one and of
    what most good instruments stay below, by the probability of that. 1 where chance explains it.

    Parameters
    ----------
    usual : probability of each component's sizes in a good instrument
    slips : covariates of which each profile has a multiple of its own that has no cause
    """
    found = louder_waves(ws, model, slips)
    if found is None or found.log <= found.unsure:
        return 1.0
    scales = Scales(sizes=SETTINGS.rate_sizes(), weights=usual)
    nats = scales.nats(LONG_WAVES, level_factors(found.log, found.unsure))
    mismatch = SETTINGS.probability(nats, "")
    most = min(found.log, scales.typical(LONG_WAVES))
    return math.exp(2.0 * (mismatch * most + (1.0 - mismatch) * found.log))


def long_wave_factors(ws: Workspace) -> dict[str, Field]:
    """Log Bayes factor of each size of what an instrument has in long waves, by its key.

    What it departs from the nominal model by is in it. {} where there are too few waves.
    """
    found = louder_waves(ws, Model())
    return {} if found is None else {LONG_WAVES: level_factors(found.log, found.unsure)}


def louder_waves(
    ws: Workspace, model: Model, slips: Collection[str] = ()
) -> LevelChange | None:
    """Measure how much louder long waves are than whitening leaves them; None of too few waves.

    What a law's error may leave of a large signal is no noise: as far as the law is doubted, and if
    all of that were in these waves. The median of the power of F waves is known to 1 / (ln 2 √F) of
    itself.

    Parameters
    ----------
    slips : as for `power_of_long_waves`
    """
    laws, plain = ws.predict(model), ws.predict(Model())
    waves, signal = [np.zeros(0)], 0.0
    for patch, state, law, bare in zip(ws.patches, ws.states(laws), laws, plain, strict=True):
        use = state.used & ~patch.edge
        if use.any():
            signal += float(np.square(state.whiten(law.mean_mm - bare.mean_mm)[use]).sum())
            moved = [
                state.whiten(np.nan_to_num(COVARIATES[name].values(patch.view)))
                for name in sorted(slips)
            ]
            waves.append(_power(_still(state.innovations, moved, use), use))
    power = np.concatenate(waves)
    if power.size < SETTINGS.least_waves:
        return None
    doubted = SETTINGS.doubt**2 * signal / power.size
    louder = max(float(np.median(power)) / math.log(2) - doubted, 1.0)
    return LevelChange(
        log=0.5 * math.log(louder), unsure=0.5 / (math.log(2) * math.sqrt(power.size))
    )


def _still(values: Field, moved: Sequence[Field], use: Mask) -> Field:
    """Take off each profile's multiple of each field that suits its readings best, (n, m)."""
    for field in moved:
        alike, own = ((a * field * use).sum(axis=1) for a in (values, field))
        values = values - (alike / np.maximum(own, 1e-12))[:, None] * field
    return values


def _power(values: Field, use: Mask) -> Field:
    """Power of each wave of a few to a patch, (F,).

    Parameters
    ----------
    values : (n, m) whitened readings
    """
    clip = SETTINGS.clip
    values = np.where(use, np.clip(values, -clip, clip), 0.0)
    values = np.where(use, values - values[use].mean(), 0.0)
    n, m = values.shape
    power = np.square(np.abs(np.fft.fft2(values))) / use.sum()
    down, right = np.fft.fftfreq(n, 1 / n)[:, None], np.fft.fftfreq(m, 1 / m)[None]
    far = np.hypot(down, right)
    low, high = SETTINGS.long_waves
    once = (down > 0) & (right != 0)
    return np.asarray(power[once & (far >= low) & (far < high)])
