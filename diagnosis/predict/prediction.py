"""Prediction: the law of each reading under a set of effects, in the arrays that scoring needs.

The plain model is the sensor's file, its effects included; the size of the noise is the calibrated
one, split into what is white and what is speckle so that effects act on either.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from diagnosis.fields import Field, Mask
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.effects.base import Effect
from sensors.effects.delivery import DeliveryEffect
from sensors.effects.row_repeat import RowRepeat
from sensors.law import Law, geometric_law
from sensors.model import as_moved, as_wide
from sensors.noise.perlin import PerlinField
from sensors.noise.uncertainty import sigma_mm
from sensors.view.covariates import COVARIATES
from sensors.view.view import KEPT_IN_ALL, KEPT_POINTS, KEPT_WIDTHS, View
from sensors.view.view_cache import ViewCache

if TYPE_CHECKING:
    from diagnosis.noise.noise_model import NoiseModel

KEPT_LAWS = 4
LOCAL_COVARIATES = {c.name for c in COVARIATES.values() if c.approximate}
"""Of effects on edges and in corners, whose laws are no more than good approximations there."""
KEPT_TRIALS = 4
"""Laws of a view that are kept for the next who asks: a trial is placed, levelled and scored.

Each time two more are asked for: that of its effects on edges alone, and the file's.
"""
_TRIALS: ViewCache[Law] = ViewCache(KEPT_TRIALS)
_LAWS: ViewCache[Law] = ViewCache(KEPT_LAWS)
_SHIFTS: ViewCache[Field] = ViewCache(KEPT_WIDTHS, room=KEPT_IN_ALL)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Prediction:
    """Law of each reading of a patch, (n, m) arrays.

    Attributes
    ----------
    mean_mm : NaN where no return is expected
    sd_mm : size of the correlated noise
    p_missing : probability of no return
    p_outlier, outlier_sd_mm : second, wide Gaussian
    """

    mean_mm: Field
    sd_mm: Field
    p_missing: Field
    p_outlier: Field
    outlier_sd_mm: Field

    @property
    def seen(self) -> Mask:
        """Where the law has a mean."""
        return np.asarray(np.isfinite(self.mean_mm))


def law_of(view: View, effects: Sequence[Effect], noise: "NoiseModel | None") -> Law:
    """Law under the sensor's own effects, each replaced by that of its name in `effects`.

    What moves the sensor comes first: the others act where it really is.
    """
    noise_mm = None if noise is None else noise.sd_mm
    return _TRIALS.get(
        view, (tuple(effects), noise_mm), lambda: _law_of(view, effects, noise_mm),
        keep=_is_small(view),
    )  # fmt: skip


def _law_of(view: View, effects: Sequence[Effect], noise_mm: float | None) -> Law:
    found = {effect.name: effect for effect in effects}
    own = [found.pop(e.name, e) for e in as_wide(view.sensor.effects, found)]
    true, others = as_moved(view, [*own, *found.values()])
    return _applied(true, tuple(others), noise_mm)


def _applied(view: View, effects: tuple[Effect, ...], noise_mm: float | None) -> Law:
    """Apply effects in order.

    Kept with the view are the laws under the file's own first ones, and under all but the last
    one: that is the one which is tried.
    """
    own = view.sensor.effects
    shared = 0
    while shared < min(len(own), len(effects)) and effects[shared] == own[shared]:
        shared += 1
    last = {len(effects) - 1} if _is_small(view) else set()
    return _built(view, effects, noise_mm, {shared} | last)


def _is_small(view: View) -> bool:
    return math.prod(view.shape) <= KEPT_POINTS


def _built(
    view: View, effects: tuple[Effect, ...], noise_mm: float | None, keep: set[int]
) -> Law:
    """Apply the last effect to the law under those before; keep what has so many effects."""

    def build() -> Law:
        if not effects:
            return _bare(view, noise_mm)
        return _with(effects[-1], _built(view, effects[:-1], noise_mm, keep), view)

    return _LAWS.get(view, (effects, noise_mm), build, keep=len(effects) in keep)


def _with(effect: Effect, law: Law, view: View) -> Law:
    """Apply an effect; a shift of the mean that has nothing to do with the law is kept.

    Noise is measured on what the firmware delivers, and profiles that it repeats are left out.
    """
    if isinstance(effect, RowRepeat):
        return law
    if isinstance(effect, DeliveryEffect):
        delivered = effect.apply(law, view)
        return replace(delivered, white_sd_mm=law.white_sd_mm, speckle_gain=law.speckle_gain)
    if effect.is_null or type(effect).shift is Effect.shift:
        return effect.apply(law, view)

    def shift() -> Field:
        for key in effect.needs:
            view.datasheet.require(key)
        return np.asarray(effect.shift(view))

    by_mm = _SHIFTS.get(view, effect, shift, size=math.prod(view.shape))
    return replace(law, mean_mm=law.mean_mm + by_mm)


def plain_gain(view: View) -> Field:
    """Size of the noise that the sensor's file gives each reading, over that of a flat, (n, m)."""
    noise_mm = max(1e-2, 4 * sigma_mm(view.datasheet))
    return np.asarray(_applied(view, view.sensor.effects, noise_mm).sd_mm(view)) / noise_mm


def _bare(view: View, noise_mm: float | None) -> Law:
    """Geometry, and noise of a size split into white and speckle."""
    law = geometric_law(view, None)
    if noise_mm is None:
        return law
    white = min(sigma_mm(view.datasheet), 0.9 * noise_mm)
    speckle = math.sqrt(noise_mm**2 - white**2)
    cell = PerlinField(amplitude_mm=1.0, cell_x_mm=1.0, cell_y_mm=1.0, octaves=1)
    scale = replace(law, speckle=cell).speckle_sd_mm(view)
    return replace(
        law, white_sd_mm=white, speckle=replace(cell, amplitude_mm=speckle / max(scale, 1e-12))
    )


def predict(
    view: View,
    effects: Sequence[Effect],
    noise: "NoiseModel",
    *,
    softness: tuple[Field, Field] | None = None,
    level: float = 1.0,
) -> Prediction:
    """Predict a patch.

    Parameters
    ----------
    softness : (sd, probability), optional
        What a small error of the pose may do at edges: further standard deviation (mm) and the
        chance that the point belongs to the other side.
    level : float
        Factor on the size of the noise.
    """
    law = law_of(view, effects, noise)
    shape = view.shape
    mean = np.array(np.broadcast_to(law.mean_mm, shape))
    sd = level * law.sd_mm(view)
    missing = np.array(np.broadcast_to(np.asarray(law.p_missing, dtype=np.float64), shape))
    seen = np.isfinite(mean)
    missing[~seen] = 1.0
    own = np.asarray(law.outlier_sd_mm, dtype=np.float64)
    if np.any(own > 0):
        missing = 1 - (1 - missing) * (1 - law.p_outlier * _beyond(mean, own, view.datasheet))
    local = [e for e in effects if e.covariate in LOCAL_COVARIATES]
    if local:
        change = law_of(view, local, noise).mean_mm - law_of(view, (), noise).mean_mm
        sd = np.hypot(sd, SETTINGS.predict.local_doubt * np.nan_to_num(np.abs(change)))
    least = SETTINGS.predict.least_missing
    base = max(noise.missing_share, least)
    missing = np.clip(1 - (1 - missing) * (1 - base), least, 1 - SETTINGS.predict.least_found)
    if softness is not None:
        sd = np.hypot(sd, softness[0])
        missing = np.clip(missing, softness[1], 1 - softness[1])
    p_outlier = np.clip(
        np.asarray(law.p_outlier, dtype=np.float64) + max(noise.tail_share, least), 0, 0.5
    )
    wide = np.where(own > 0, np.maximum(own, noise.tail_sd_mm), noise.tail_sd_mm)
    return Prediction(
        mean_mm=mean,
        sd_mm=np.broadcast_to(sd, shape),
        p_missing=missing,
        p_outlier=np.broadcast_to(p_outlier, shape),
        outlier_sd_mm=np.broadcast_to(wide, shape),
    )


def _beyond(mean_mm: Field, sd_mm: Field, sheet: Datasheet) -> Field:
    """Chance that a spike leaves the working range, and so comes as no reading."""
    wide = np.where(sd_mm > 0, sd_mm, 1.0)
    out = ndtr((sheet.depth_min_mm - mean_mm) / wide) + ndtr((mean_mm - sheet.depth_max_mm) / wide)
    return np.where(np.isfinite(mean_mm) & (sd_mm > 0), out, 0.0)


def starting(kind: type[Effect], view: View) -> Effect:
    """Return the effect as the sensor's file lists it, or a fresh one."""
    return next((e for e in view.sensor.effects if e.name == kind.name), None) or kind()


def effects_for(
    effects: Sequence[Effect], own: Mapping[str, Mapping[str, float]]
) -> tuple[Effect, ...]:
    """Give the effects one recording's own parameters, by effect's name."""
    return tuple(
        effect.with_parameters(own[effect.name]) if effect.name in own else effect
        for effect in effects
    )
