"""Surface texture: whether its noise is as large, as fine, as even as the nominal one.

Compared are the noise on the part, where it is hit squarely, and the plate's (or that of the
surface's file): a factor on its size, a factor on its peaks, a direction along which it is drawn
out on the part.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.claims.lay import LAY, lay_of
from diagnosis.claims.plate_noise import change_since, level_change, plates_doubt
from diagnosis.data.patch import Patch, all_fitted
from diagnosis.evidence.changed_sizes import with_sizes_up_to
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_level import claimed_sizes, level_nats, level_unsure
from diagnosis.model.workspace import Workspace
from diagnosis.noise.calibration import nominal_noise, nominal_sd_mm
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.uncertainty import Estimate, plain_values
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect, plainly_found
from diagnosis.validate.heldout import judge
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.base import Effect
from sensors.effects.roughness_level import RoughnessLevel
from sensors.noise.uncertainty import sigma_mm

if TYPE_CHECKING:
    from diagnosis.explanation import Explanation
    from diagnosis.prepare import Prepared


@dataclass(frozen=True, kw_only=True, slots=True)
class Claim:
    """An effect on the surface's texture, and the evidence for it.

    Attributes
    ----------
    nats : log Bayes factor against a good instrument on a surface as claimed
    heldout : by how much the held-out readings raise it, where they do; elsewhere they have to be
        more probable with the noise that the fitted ones show
    """

    effect: Effect
    nats: float
    heldout: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Left:
    """What is left unexplained, as far as it passes for noise of the surface.

    Its waves have directions as well: up to the share of the variance that it has, good instruments
    may seem to have a lay. The level of the noise is in doubt by as much.

    Attributes
    ----------
    mean : rms of the mean, over the noise
    noise : rms of the noise's logarithm
    """

    mean: float = 0.0
    noise: float = 0.0

    @property
    def level(self) -> float:
        """By how much it may change the logarithm of the noise's size."""
        return math.hypot(0.5 * math.log1p(self.mean**2), self.noise)


def texture(
    ready: "Prepared", explanation: "Explanation", *, left: Left, withheld: Collection[str]
) -> tuple[list[FoundEffect], NoiseModel]:
    """Compare the noise with what plates, baselines or the surface's file claim.

    Parameters
    ----------
    left : unexplained, which passes for noise

    Returns
    -------
    effects on the surface's texture; the nominal noise
    """
    model, noise, nominal, surface = explanation.model, ready.noise, ready.nominal, ready.surface
    view = explanation.ws.patches[0].view
    if ready.filtered is not None:
        # what it leaves tells nothing of the finish
        return [], nominal_noise(noise, nominal, surface, view)
    claimed = nominal_sd_mm(nominal, surface, view)
    level = None
    if claimed > 0:
        level = _level(explanation, noise, nominal, claimed, ready.baseline, left)
    lay = None if nominal is None else _lay(explanation, noise, nominal, ready.baseline, left)
    claims = [c for c in joined(level, lay) if c.effect.name not in withheld]
    if not claims:
        return [], noise
    plain_noise = nominal_noise(noise, nominal, surface, view)
    plain, sized, whole = (
        judge(explanation.held, n, model, share_own=not ready.single).log_score
        for n in (plain_noise, replace(plain_noise, sd_mm=noise.sd_mm), noise)
    )
    readings = sum(int(p.scored.sum()) for p in explanation.held)
    found = []
    for claim in claims:
        gain = plain - whole
        if len(claims) > 1 and isinstance(claim.effect, RoughnessLevel):
            # what has a lay has it at its level: the level alone is the lesser explanation
            gain = min(plain - sized, gain)
        nats = min(readings * gain, claim.nats)
        if claim.heldout is not None:
            gain, nats = claim.heldout / readings, claim.nats
        sure = SETTINGS.probability(nats, claim.effect.name)
        if sure > SETTINGS.reported:
            values = texture_estimates(claim.effect)
            found.append(plainly_found(claim.effect, gain, values, probability=sure))
    return found, plain_noise


def joined(level: Claim | None, lay: Claim | None) -> list[Claim]:
    """Put a level and a lay together."""
    rough = None if level is None else level.effect
    if lay is not None and isinstance(rough, RoughnessLevel) and rough.amplitude > 1:
        # the ridges of a lay are what makes it rougher
        most = lay.effect.parameter("amplitude").high
        effect = lay.effect.with_parameters({"amplitude": min(rough.amplitude, most)})
        return [replace(lay, effect=effect)]
    return [c for c in (level, lay) if c is not None]


def _level(
    explanation: "Explanation", own: NoiseModel, nominal: NoiseModel | None, nominal_mm: float,
    baseline: Sequence[Patch], left: Left,
) -> Claim | None:  # fmt: skip
    """Return the change of the noise's size and of its peaks; None where there is none."""
    ws, model = explanation.ws, explanation.model
    view = ws.patches[0].view
    doubt = math.hypot(plates_doubt(model, view), left.level)
    # what the noise goes with in a good instrument changes its size there, too
    beside = {name for u in explanation.usual if u.channel == "scale" for name in u.follows}
    if baseline:
        every = Workspace.build(all_fitted(explanation.patches), own)
        before = Workspace.build(baseline, own)
        change, nats = change_since(every, model, before, explanation.scales, doubt, beside)
    else:
        change = level_change(ws, model, nominal_mm, beside)
        plate = 0.0 if nominal is None else level_unsure(nominal)
        usual = claimed_sizes() if nominal is None else explanation.scales
        unsure = math.hypot(change.unsure, doubt, plate)
        nats = level_nats(replace(change, unsure=unsure), usual)
    if nats + SETTINGS.log_odds(RoughnessLevel.name) <= 0:
        return None
    white, size = sigma_mm(view.datasheet), nominal_mm * math.exp(change.log)
    amplitude = math.sqrt(max(size**2 - white**2, 1e-12) / max(nominal_mm**2 - white**2, 1e-12))
    peaks = 1.0
    if nominal is not None:
        was, now = nominal.correlation_length_px(), own.correlation_length_px()
        peaks = math.sqrt(was[0] * was[1] / max(now[0] * now[1], 1e-9))
        peaks = 1.0 if abs(math.log(peaks)) < math.log(SETTINGS.claims.finer) else peaks
    effect = RoughnessLevel(
        amplitude=float(np.clip(amplitude, 0.05, 20)), peaks=float(np.clip(peaks, 0.05, 20))
    )
    return Claim(effect=effect, nats=nats)


def _lay(
    explanation: "Explanation", noise: NoiseModel, nominal: NoiseModel, baseline: Sequence[Patch],
    left: Left,
) -> Claim | None:  # fmt: skip
    """Return the lay of the part; None where there is none.

    Held-out recordings say in which frame it lies, too: noise that is drawn out in one orientation
    is no prediction of another's.
    """
    scales = Scales(sizes=SETTINGS.mean_sizes(), weights=explanation.scales)
    usual = with_sizes_up_to(left.mean**2, scales.of(LAY), scales.sizes)
    scales = replace(scales, weights={LAY: usual})

    def found_on(patches: Sequence[Patch]) -> tuple[AnisotropicLay, float] | None:
        ws = Workspace.build(patches, noise)
        found = lay_of(ws, explanation.model, nominal, baseline)
        return None if found is None else (found[0], scales.nats(LAY, found[1]))

    found = found_on(all_fitted(explanation.patches))
    if found is None or found[1] + SETTINGS.log_odds(AnisotropicLay.name) <= 0:
        return None
    fitted = found_on(explanation.patches)
    heldout = found[1] - (0.0 if fitted is None else fitted[1])
    return Claim(effect=found[0], nats=found[1], heldout=heldout if heldout >= 0 else None)


def texture_estimates(effect: Effect) -> dict[str, Estimate]:
    """Return values without intervals: how alike a plate and a part are was not measured."""
    values = {n: getattr(effect, n, None) for n in ("amplitude", "ratio", "angle_deg")}
    return plain_values({n: float(v) for n, v in values.items() if v is not None})
