"""Recordings settled under the chosen model: placed anew, with their own parameters."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.heldout import judging_masks, settle_own
from diagnosis.law_placement import placed_by_law
from diagnosis.noise import Field, NoiseModel
from diagnosis.patch import Patch, cut
from diagnosis.prediction import predict
from diagnosis.registration import PRIOR_SD, Placement, register
from diagnosis.workspace import Model, Workspace
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.recording import Recording

NEAR_MM, NEAR_SD = 0.03, 3.0
"""A placement changes no further than this, sideways and in units of the noise, for nothing."""


def placed_anew(
    model: Model,
    patches: Sequence[Patch],
    recordings: Sequence[Recording],
    scene: Scene,
    datasheet: Datasheet,
    laser: dict[str, Laser],
    placed: dict[str, Placement],
    noise: NoiseModel,
    lateral: float,
    *,
    by_law: bool,
) -> list[Patch]:
    """Place each recording anew with the effects in the model.

    Under the plain model a placement gives way to what it lacks, by tenths of a millimetre where
    the part is smooth: far enough for curvature to bend what was linear. Recordings that hardly
    move, or are looked at in strips, stay where they are.

    Parameters
    ----------
    placed : each recording's placement, brought up to date
    by_law : whether the model's word on edges counts, or silhouettes as if they were sharp
    """
    out: list[Patch] = []
    moved = {} if by_law else _by_all(patches, noise, model)
    for number, recording in enumerate(recordings):
        own = [p for p in patches if p.recording == number]
        patch, before, rays = own[0], placed[recording.name], laser[recording.name]
        if len(own) > 1 or patch.shape[0] < recording.depth_mm.shape[0]:
            placement = before
        elif by_law:
            placement = placed_by_law(patch, before, model, noise)
        elif _stays(patch, moved[number], noise):
            placement = before
        else:
            law = predict(patch.view, model.of(number), noise, softness=patch.softness)
            placement = register(
                scene, recording, rays, datasheet=datasheet, valid=patch.observed,
                offset_mm=np.nan_to_num(law.mean_mm - patch.view.depth_mm),
                sd_mm=noise.sd_mm, spread=law.sd_mm / noise.sd_mm,
            )  # fmt: skip
        if placement is before:
            out += own
            continue
        again = cut(
            number, recording, placement, scene, datasheet, rays,
            lateral_mm=lateral, held_out=patch.scored,
        )  # fmt: skip
        if _density(again, noise, model) > _density(own, noise, model):
            placed[recording.name] = placement
            out += again
        else:
            out += own
    return out


def _density(own: Sequence[Patch], noise: NoiseModel, model: Model) -> float:
    """Log density of a recording where it lies, in nats, the placement refitted to first order."""
    ws = Workspace.build(own, noise)
    still = ws.placements(model, [p.counted for p in own])
    return float(sum(d.sum() for d in ws.log_densities(model, placements=still)))


def _stays(patch: Patch, shift: Field, noise: NoiseModel) -> bool:
    """Whether a placement is so near that what is linear in it is all there is."""
    far = np.abs(shift * PRIOR_SD)[:3].max() > NEAR_MM
    deep = np.abs(patch.columns @ shift).max() > NEAR_SD * noise.sd_mm
    return not (far or deep)


def settled(
    patches: Sequence[Patch],
    plainly: Sequence[Patch],
    noise: NoiseModel,
    model: Model,
    share_own: bool,
) -> tuple[Model, dict[str, dict[int, Field]]]:
    """Return the model with held-out recordings' own parameters, and each one's placements.

    Placements are those under the "plain" and the "final" model, by recording.

    Parameters
    ----------
    patches, plainly : where the model and where the plain one puts the recordings
    """
    if share_own:
        held = [p for p in patches if p.scored.any()]
        small, _ = judging_masks(held, True)
        settled = settle_own(Workspace.build(held, noise), model, small)
        own = {**{k: dict(v) for k, v in model.own.items()}}
        for r, values in settled.own.items():
            own.setdefault(r, {}).update(
                {k: v for k, v in values.items() if k not in own.get(r, {})}
            )
        model = replace(model, own=own)
    return model, {
        "plain": _by_all(plainly, noise, Model()), "final": _by_all(patches, noise, model)
    }  # fmt: skip


def _by_all(patches: Sequence[Patch], noise: NoiseModel, model: Model) -> dict[int, Field]:
    """Place each recording by all its readings, held out or not."""
    return Workspace.build(patches, noise).placements(model, [p.counted for p in patches])
