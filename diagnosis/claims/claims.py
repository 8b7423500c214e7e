"""What recordings show against claims: surface texture, mounting of the sensor.

The noise is compared with what plates, baselines or the surface's file claim, placements with the
commanded poses.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.claims.firmware import filtered_instead
from diagnosis.claims.mounting import LEAST_NATS, mounting_error
from diagnosis.claims.surface_texture import finish_effects, finish_estimates
from diagnosis.data.patch import Patch
from diagnosis.model.workspace import Model, Workspace
from diagnosis.noise.calibration import nominal_noise, nominal_sd_mm
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.register.placement import Placement
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect, plainly_found, probability
from diagnosis.validate.heldout import judge
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.onboard_filter import OnboardFilter
from sensors.recording import Recording
from sensors.surface.surface import Surface

if TYPE_CHECKING:
    from diagnosis.explain import Explanation


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
    effects = finish_effects(ws, model, noise, nominal, claimed, explanation.scales, bent=bent)
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
            e, gains[e.name], finish_estimates(e),
            probability=probability(readings * gains[e.name], e.name),
        )
        for e in effects
        if readings * gains[e.name] + SETTINGS.log_odds(e.name) > 0
    ]  # fmt: skip
    return found, plain_noise


def mounted(
    ws: Workspace,
    model: Model,
    recordings: Sequence[Recording],
    placed: Mapping[str, Placement],
    held: Sequence[Patch],
) -> list[FoundEffect]:
    """Return the mounting error that fitted recordings share, if held-out recordings support it."""
    moved = ws.placements(model)
    fitted = [placed[recordings[k].name].further(moved[k]) for k in moved]
    mounting = mounting_error(
        [recordings[k].poses for k in moved], fitted, travel_mm=travelled_mm(ws, model)
    )
    if mounting is None:
        return []
    apart = Workspace.build(held, ws.noise)
    moved = apart.placements(model, [p.counted & ~p.edge for p in held])
    gain = sum(
        mounting.gain(recordings[k].poses, placed[recordings[k].name].further(step))
        for k, step in moved.items()
    )
    if gain < LEAST_NATS:
        return []
    per_reading = gain / max(sum(int(p.counted.sum()) for p in held), 1)
    return [
        plainly_found(
            mounting.effect, per_reading, mounting.intervals,
            probability=1.0 - np.exp(-gain),
        )
    ]  # fmt: skip


def travelled_mm(ws: Workspace, model: Model) -> float:
    """Half of the longest way during an exposure: where in it a pose is stated isn't known."""
    ways = [blur.longest_way_mm(p.view) for blur in blurs(model) for p in ws.patches]
    return 0.5 * float(max(ways, default=0.0))


def blurs(model: Model) -> list[MotionBlur]:
    """Return the blurs of a model."""
    return [e for e in model.effects if isinstance(e, MotionBlur)]
