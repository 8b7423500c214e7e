"""Surface texture: whether its noise is as large, as fine, as even as the nominal one.

Compared are the noise on the part, where it is hit squarely, and the plate's (or that of the
surface's file): a factor on its size, a factor on its peaks, a direction along which it is drawn
out on the part.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.claims.firmware import filtered_instead
from diagnosis.claims.lay import LAY_TOLERANCE, lay_of
from diagnosis.claims.plate_noise import level_change, plates_doubt
from diagnosis.evidence.noise_level import claimed_sizes, level_odds, level_unsure
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.calibration import nominal_noise, nominal_sd_mm
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.uncertainty import Estimate, plain_values
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect, plainly_found, probability
from diagnosis.validate.heldout import judge
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.base import Effect
from sensors.effects.onboard_filter import OnboardFilter
from sensors.effects.roughness_level import RoughnessLevel
from sensors.noise.uncertainty import sigma_mm
from sensors.surface.surface import Surface

if TYPE_CHECKING:
    from diagnosis.explain import Explanation

SURELY_LESS = 0.75
"""Factor on a plate's noise that is told beside a bent mean, too, which only adds to noise."""


def texture(
    explanation: "Explanation",
    noise: NoiseModel,
    nominal: NoiseModel | None,
    surface: Surface | None,
    *,
    bent: bool,
    withheld: Collection[str],
    share_own: bool,
) -> tuple[list[FoundEffect], NoiseModel]:
    """Compare the noise with what plates, baselines or the surface's file claim.

    Returns
    -------
    effects on the surface's texture; the nominal noise
    """
    model, ws = explanation.model, explanation.ws
    view = ws.patches[0].view
    claimed = nominal_sd_mm(nominal, surface, view)
    effects = texture_effects(ws, model, noise, nominal, claimed, explanation.scales, bent=bent)
    if surface is not None and nominal is None and OnboardFilter.name not in withheld:
        effects = filtered_instead(effects, noise, surface, view)
    effects = [e for e in effects if e.name not in withheld]
    if not effects:
        return [], noise
    plain_noise = nominal_noise(noise, nominal, surface, view)
    plain, level, whole = (
        judge(explanation.held, n, model, share_own=share_own).log_score
        for n in (plain_noise, replace(plain_noise, sd_mm=noise.sd_mm), noise)
    )
    # what has a lay has it at its level: the level alone is the lesser explanation
    gains = {e.name: plain - whole for e in effects}
    if len(effects) > 1:
        gains["roughness_level"] = min(plain - level, plain - whole)
    readings = sum(int(p.scored.sum()) for p in explanation.held)
    found = [
        plainly_found(
            e, gains[e.name], texture_estimates(e),
            probability=probability(readings * gains[e.name], e.name),
        )
        for e in effects
        if readings * gains[e.name] + SETTINGS.log_odds(e.name) > 0
    ]  # fmt: skip
    return found, plain_noise


def texture_effects(
    ws: Workspace,
    model: Model,
    own: NoiseModel,
    nominal: NoiseModel | None,
    nominal_sd_mm: float,
    usual: Mapping[str, Field],
    *,
    bent: bool = False,
) -> list[Effect]:
    """Effects on the noise's level and direction against a nominal noise.

    Parameters
    ----------
    nominal : the plates' noise; None where only a surface's file is known
    nominal_sd_mm : nominal size; 0 where nothing is claimed
    usual : probability of each component's sizes in a good instrument
    bent : whether much of the mean is left unexplained, which passes for noise: told is no more
        than a lay that draws the noise out by far, whose ridges bend the mean themselves, and noise
        that is far smaller all the same
    """
    effects: list[Effect] = []
    white = sigma_mm(ws.patches[0].view.datasheet)
    if nominal_sd_mm > 0:
        change = level_change(ws, model, nominal_sd_mm)
        size = nominal_sd_mm * math.exp(change.log)
        unsure = math.hypot(change.unsure, plates_doubt(model, ws.patches[0].view))
        unsure = math.hypot(unsure, 0.0 if nominal is None else level_unsure(nominal))
        if level_odds(change.log, unsure, claimed_sizes() if nominal is None else usual) > 0:
            amplitude = math.sqrt(
                max(size**2 - white**2, 1e-12) / max(nominal_sd_mm**2 - white**2, 1e-12)
            )
            peaks = 1.0
            if nominal is not None:
                was, now = nominal.correlation_length_px(), own.correlation_length_px()
                peaks = math.sqrt(was[0] * was[1] / max(now[0] * now[1], 1e-9))
                peaks = 1.0 if abs(math.log(peaks)) < 0.3 else peaks
            effects.append(
                RoughnessLevel(
                    amplitude=float(np.clip(amplitude, 0.05, 20)),
                    peaks=float(np.clip(peaks, 0.05, 20)),
                )
            )
    if nominal is not None:
        level = next((e for e in effects if isinstance(e, RoughnessLevel)), None)
        rougher = level is not None and level.amplitude > 1
        lay = lay_of(ws, model, nominal, rougher=rougher)
        if lay is not None:
            if level is not None and rougher:
                # the ridges of a lay are what makes it rougher
                effects = []
                lay = replace(lay, amplitude=min(level.amplitude, lay.parameter("amplitude").high))
            effects.append(lay)
    if bent:
        return [e for e in effects if _stands_out(e)]
    return effects


def _stands_out(effect: Effect) -> bool:
    """Whether a finish is told although a bent mean adds to the noise."""
    if isinstance(effect, AnisotropicLay):
        return math.log(effect.ratio) > 2 * LAY_TOLERANCE
    return isinstance(effect, RoughnessLevel) and effect.amplitude < SURELY_LESS


def texture_estimates(effect: Effect) -> dict[str, Estimate]:
    """Return values without intervals: how alike a plate and a part are was not measured."""
    names = (
        "amplitude", "ratio", "angle_deg",
        "median_points", "median_profiles", "mean_points", "mean_profiles",
    )  # fmt: skip
    values = {n: getattr(effect, n, None) for n in names}
    return plain_values({n: float(v) for n, v in values.items() if v is not None})
