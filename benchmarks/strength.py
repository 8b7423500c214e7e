"""Strength of an effect in the bench's recordings: whitened signal-to-noise ratio, √(2 gain).

The gain is the log-likelihood, nats, of the true law over the nominal one on all fitted readings:

- of bulk physics, expected, the pose projected out;
- of what lives on depth edges, where poses are uncertain, those of simulated recordings;
- of a surface texture, which changes only the noise, that of two stationary Gaussian
  fields, 1/2 Σ_k [S1/S0 - 1 - ln(S1/S0)] over their spectra (Whittle 1953);
- of a mounting, 1/2 Σ δᵀ C⁻¹ δ over the recordings, C how parts lie by chance.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from diagnosis.model.log_density import placements, whitened
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.edges import EDGE_COVARIATES
from diagnosis.predict.prediction import predict
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.effects import effect_of
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.effect import Effect
from sensors.effects.pose_error import PoseError
from sensors.effects.roughness_level import RoughnessLevel
from sensors.noise.uncertainty import sigma_mm
from tests.support.effect_case import Case, Entry
from tests.support.small_parts import MISPLACED


def strength(case: Case, effect: Entry) -> float:
    """Whitened signal to noise of an effect."""
    thing = effect_of(dict(effect))
    if thing.undrawn():
        thing = thing.draw(np.random.default_rng(0))
    if isinstance(thing, PoseError):
        return _mounting_strength(thing, case.count)
    ws = case.workspace
    if isinstance(thing, RoughnessLevel | AnisotropicLay):
        white = sigma_mm(ws.patches[0].view.datasheet)
        nats = sum(finish_nats(thing, ws.noise, p.shape, white) for p in ws.patches)
    elif thing.covariate in EDGE_COVARIATES:
        nats = _simulated_nats(ws, thing, case)
    else:
        nats = _expected_nats(ws, thing)
    return float(np.sqrt(2 * max(nats, 0.0)))


def finish_nats(
    effect: RoughnessLevel | AnisotropicLay,
    noise: NoiseModel,
    shape: tuple[int, int],
    white_mm: float,
) -> float:
    """Kullback-Leibler divergence, nats, between noise (n, m) with and without a texture.

    Parameters
    ----------
    white_mm : share of the noise that isn't speckle, standard deviation, mm
    """
    share = min((white_mm / noise.sd_mm) ** 2, 0.99)
    before = noise.spectrum(shape)
    if isinstance(effect, AnisotropicLay):
        after = replace(noise, acf=_drawn_out(noise, effect, share)).spectrum(shape)
    else:
        after = effect.amplitude**2 * (before - share) + share
    least = max(share, 1e-3)
    ratio = np.maximum(after, least) / np.maximum(before, least)
    whole = shape[0] * shape[1] / ratio.size
    return 0.5 * whole * float((ratio - 1 - np.log(ratio)).sum())


def _drawn_out(noise: NoiseModel, lay: AnisotropicLay, white: float) -> NDArray[np.float64]:
    """Autocorrelation with the lay's ellipse, its angle taken from the columns on.

    Parameters
    ----------
    white : share of the variance that the lay leaves alone
    """
    ly, lx = noise.lags
    nugget = np.zeros(noise.acf.shape)
    nugget[ly, lx] = white
    rows, columns = np.mgrid[-ly : ly + 1, -lx : lx + 1].astype(np.float64)
    x, y = columns * noise.pitch_x_mm, rows * noise.pitch_y_mm
    turn = math.radians(lay.angle_deg)
    along = (x * math.cos(turn) + y * math.sin(turn)) / math.sqrt(lay.ratio)
    across = (y * math.cos(turn) - x * math.sin(turn)) * math.sqrt(lay.ratio)
    x, y = (
        along * math.cos(turn) - across * math.sin(turn),
        along * math.sin(turn) + across * math.cos(turn),
    )
    places = [y / noise.pitch_y_mm + ly, x / noise.pitch_x_mm + lx]
    return np.asarray(map_coordinates(noise.acf - nugget, places, order=3) + nugget)


def _mounting_strength(effect: PoseError, recordings: int) -> float:
    """Signal to noise of a mounting against how the bench's parts lie by chance."""
    turns = [math.radians(a) for a in (effect.roll_deg, effect.pitch_deg, effect.yaw_deg)]
    ways = [effect.x_mm, effect.y_mm, effect.z_mm]
    off = np.array([*turns, *ways]) / np.repeat(MISPLACED, 3)
    return float(np.sqrt(recordings * (off @ off)))


def _simulated_nats(ws: Workspace, thing: Effect, case: Case) -> float:
    """Nats that the law of an effect gains on the bench's recordings, taken with it."""
    there = case.taken_with(ws, thing)
    plain, true = (there.log_densities(m) for m in (Model(), Model(effects=(thing,))))
    return float(there.block_scores([t - p for t, p in zip(true, plain, strict=True)]).sum())


def _expected_nats(ws: Workspace, thing: Effect) -> float:
    nats = 0.0
    base = ws.predict(Model())
    raw = [whitened(p, q, ws.noise) for p, q in zip(ws.patches, base, strict=True)]
    signals = []
    for patch, plain, state in zip(ws.patches, base, raw, strict=True):
        other = predict(patch.view, (thing,), ws.noise, softness=patch.softness)
        both = plain.seen & other.seen
        # at an edge one reading may be off by millimetres and still counts as one
        most = np.where(patch.edge, SETTINGS.clip * plain.sd_mm, 0.3)
        change = np.where(both, np.nan_to_num(other.mean_mm) - np.nan_to_num(plain.mean_mm), 0.0)
        signals.append(
            replace(state, innovations=state.whiten(np.clip(change, -most, most)))
        )
        p, q = other.p_missing, plain.p_missing
        nats += float((p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q)))[plain.seen].sum())
        ratio = (other.sd_mm / plain.sd_mm)[both]
        ratio = ratio / np.exp(np.mean(np.log(ratio)))
        nats += float((0.5 * ratio**2 - 0.5 - np.log(ratio)).sum())
        o, b = other.p_outlier[both], plain.p_outlier[both]
        nats += float((o * np.log(o / b) + (1 - o) * np.log((1 - o) / (1 - b))).sum())
    moved = placements(ws.patches, signals, ws.masks())
    for patch, signal in zip(ws.patches, signals, strict=True):
        rest = signal.innovations - signal.columns @ moved[patch.recording]
        nats += 0.5 * float((rest[signal.used] ** 2).sum())
    return nats


def at_strength(case: Case, wanted: float) -> Entry | None:
    """Scale the effect of a case to a signal to noise; None where its bounds end before."""
    low, high = 1e-4, 30.0
    try:
        if strength(case, case.entry(high)) < wanted:
            return None
        for _ in range(14):
            middle = float(np.sqrt(low * high))
            if strength(case, case.entry(middle)) < wanted:
                low = middle
            else:
                high = middle
    except RecipeError:
        return None
    return case.entry(high)
