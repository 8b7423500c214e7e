"""Registration again under a model: where the recordings lie if its effects are there."""

from collections.abc import Mapping, Sequence

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.data.recorded import Recorded
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.register.placement import PRIOR_SD, Placement
from diagnosis.settings import SETTINGS


def reregistered(
    model: Model,
    patches: Sequence[Patch],
    recorded: Recorded,
    placed: Mapping[str, Placement],
    noise: NoiseModel,
) -> tuple[Sequence[Patch], Mapping[str, Placement]]:
    """Place each recording anew with the effects in the model; patches, and placements by name.

    Under the nominal model a placement takes up part of what that lacks, by tenths of a millimetre
    where the part is smooth: far enough for curvature to bend what was linear. Recordings that
    hardly move, or are looked at in strips, stay where they are.

    Parameters
    ----------
    placed : each recording's placement so far
    """
    if model.is_nominal:
        return patches, placed
    out: list[Patch] = []
    found = dict(placed)
    moved = by_all_readings(patches, noise, model)
    for number, recording in enumerate(recorded.recordings):
        own = [p for p in patches if p.recording == number]
        if _is_whole(own, recorded, number) and not _stays(own[0], moved[number], noise):
            placement = registered_under(model, own[0], recorded, noise)
            again = recorded.cut(number, placement)
            if log_density(again, noise, model) > log_density(own, noise, model):
                found[recording.name], own = placement, again
        out += own
    return out, found


def _is_whole(own: Sequence[Patch], recorded: Recorded, number: int) -> bool:
    """Whether a recording is looked at as a whole, and not in strips."""
    return len(own) == 1 and own[0].shape == recorded.recordings[number].depth_mm.shape


def registered_under(
    model: Model, patch: Patch, recorded: Recorded, noise: NoiseModel
) -> Placement:
    """Register a recording, one patch, with what a model expects beyond the geometric depth."""
    law = Workspace.build([patch], noise).predict(model)[0]
    return recorded.register(
        patch.recording, patch.observed, law.mean_mm - patch.view.depth_mm, noise.sd_mm,
        law.sd_mm / noise.sd_mm,
    )  # fmt: skip


def log_density(own: Sequence[Patch], noise: NoiseModel, model: Model) -> float:
    """Log density of a recording where it lies, nats, the placement refitted to first order."""
    ws = Workspace.build(own, noise)
    still = ws.placements(model, [p.counted for p in own])
    return float(sum(d.sum() for d in ws.log_densities(model, placements=still)))


def by_all_readings(
    patches: Sequence[Patch], noise: NoiseModel, model: Model
) -> dict[int, Field]:
    """Place each recording to first order by all its readings, held out or not."""
    return Workspace.build(patches, noise).placements(model, [p.counted for p in patches])


def _stays(patch: Patch, shift: Field, noise: NoiseModel) -> bool:
    """Whether a placement is so near that what is linear in it is all there is."""
    far = np.abs(shift * PRIOR_SD)[:3].max() > SETTINGS.reregister.near_mm
    deep = np.abs(patch.columns @ shift).max() > SETTINGS.reregister.near_sd * noise.sd_mm
    return not (far or deep)
