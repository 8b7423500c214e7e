"""Registration again under a model: where the recordings lie if its effects are there."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.data.recorded import Recorded
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.register.placement import PRIOR_SD, Placement
from diagnosis.reregister.edge_placement import placed_by_law
from diagnosis.settings import SETTINGS


def placed_anew(
    model: Model,
    patches: Sequence[Patch],
    recorded: Recorded,
    placed: Mapping[str, Placement],
    noise: NoiseModel,
    *,
    by_law: bool,
    settled: Collection[int] = (),
) -> tuple[list[Patch], dict[str, Placement]]:
    """Place each recording anew with the effects in the model; patches, and placements by name.

    Under the nominal model a placement takes up part of what that lacks, by tenths of a millimetre
    where the part is smooth: far enough for curvature to bend what was linear. Recordings that
    hardly move, or are looked at in strips, stay where they are.

    Parameters
    ----------
    placed : each recording's placement so far
    by_law : whether the model's law at edges counts, or silhouettes as if they were sharp
    settled : recordings that are known to lie well under this model
    """
    out: list[Patch] = []
    found = dict(placed)
    moved = {} if by_law else by_all_readings(patches, noise, model)
    for number, recording in enumerate(recorded.recordings):
        own = [p for p in patches if p.recording == number]
        before = placed[recording.name]
        if number in settled or not is_whole(own, recorded, number):
            placement = before
        elif by_law:
            placement = placed_by_law(own[0], before, model, noise)
        elif _stays(own[0], moved[number], noise):
            placement = before
        else:
            placement = registered_under(model, own[0], recorded, noise)
        if placement is not before:
            again = recorded.cut(number, placement)
            if log_density(again, noise, model) > log_density(own, noise, model):
                found[recording.name], own = placement, again
        out += own
    return out, found


def reregistered(
    model: Model,
    patches: Sequence[Patch],
    recorded: Recorded,
    placed: Mapping[str, Placement],
    noise: NoiseModel,
) -> tuple[Sequence[Patch], Mapping[str, Placement]]:
    """Place recordings anew under a model while that still moves them."""
    if model.is_nominal:
        return patches, placed
    settled: set[int] = set()
    for _ in range(SETTINGS.placed):
        before = patches
        patches, placed = placed_anew(
            model, patches, recorded, placed, noise, by_law=False, settled=settled
        )
        # the same again would come out for them
        settled |= {a.recording for a, b in zip(before, patches, strict=True) if a is b}
        if settled.issuperset(p.recording for p in patches):
            break
    return patches, placed


def is_whole(own: Sequence[Patch], recorded: Recorded, number: int) -> bool:
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
