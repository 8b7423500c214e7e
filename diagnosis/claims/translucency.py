"""Translucent material: its noise is another than a surface's.

Light from many depths averages speckle. And the lit volume differs from place to place with the
material's grain, which adds to the noise: on marble by a multiple (Godin et al., Proc. SPIE 4298
(2001)).
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect
from sensors.effects.base import Effect
from sensors.effects.roughness_level import RoughnessLevel
from sensors.effects.volume_scattering import VolumeScattering

SPRAY = ", too: to tell them apart, spray the part matt and record again."
FINER = " Light from within a translucent material averages speckle" + SPRAY
COARSER = " The grain of a translucent material adds to the noise" + SPRAY
UNSUNKEN = (
    " It changes the noise; how deep it goes hardly shows. A plate of another finish would do that"
    + SPRAY
)


def sunken(
    ws: Workspace, model: Model, finishes: Sequence[Effect], withheld: Collection[str]
) -> Model:
    """Return the model with the material that averages speckle as no finish does, if it fits.

    Speckle of a surface that is rough beyond the wavelength doesn't depend on how rough it is
    (Dorsch, Häusler and Herrmann, Appl. Opt. 33 (1994) 1306); light from many depths averages it.
    How deep it lets the light in shows at edges, if at all: flats sink as a part does that lies
    deeper.
    """
    most = SETTINGS.claims.averaged
    falls = any(isinstance(e, RoughnessLevel) and e.amplitude < most for e in finishes)
    if not falls or VolumeScattering.name in {*withheld, *model.names()}:
        return model
    states = ws.states(ws.predict(model))
    fitted = fit_effect(VolumeScattering, ws, model, states, masks=ws.masks())
    if fitted is None or fitted.effect.is_null or fitted.gain <= 0:
        return model
    return model.with_effect(fitted.effect, fitted.own)


def averaged_grain(
    found: Sequence[FoundEffect], beside: Sequence[FoundEffect], withheld: Collection[str]
) -> tuple[tuple[FoundEffect, ...], list[FoundEffect]]:
    """Give a translucent material the change of its noise.

    Returns both lists, without a `roughness_level` that this accounts for; one by itself has the
    material as its rival.
    """
    volume = next((f for f in found if isinstance(f.effect, VolumeScattering)), None)
    level = next((f for f in beside if isinstance(f.effect, RoughnessLevel)), None)
    if level is None:
        return tuple(found), list(beside)
    assert isinstance(level.effect, RoughnessLevel)
    grain = level.effect.amplitude
    if volume is None:
        if VolumeScattering.name in withheld:
            return tuple(found), list(beside)
        finish = SETTINGS.claims.of_finish
        rival = (VolumeScattering.name, level.heldout_gain, (1 - finish) * level.probability)
        either = replace(
            level,
            statement=level.statement + (COARSER if grain > 1 else FINER),
            probability=finish * level.probability,
            alternatives=(*level.alternatives, rival),
        )
        return tuple(found), [either if f is level else f for f in beside]
    low, high = (volume.effect.parameter("grain").low, volume.effect.parameter("grain").high)
    if not low <= grain <= high:
        return tuple(found), list(beside)
    depth = volume.parameters.get("depth_um")
    # without a law it was named by what the mean follows
    shown = depth is None or (depth.low or 0.0) > 0
    sure = max(volume.probability, level.probability)
    both = replace(
        volume, none_of_these=1 - sure,
        effect=volume.effect.with_parameters(grain=grain),
        statement=volume.statement + ("" if shown else UNSUNKEN),
        heldout_gain=volume.heldout_gain + level.heldout_gain,
        parameters={**volume.parameters, "grain": level.parameters["amplitude"]},
        probability=sure if shown else 0.5 * sure,
        alternatives=(
            volume.alternatives
            if shown
            else ((level.name, level.heldout_gain, 0.5 * sure),)
        ),
    )
    return (
        tuple(both if f is volume else f for f in found),
        [f for f in beside if f is not level],
    )
