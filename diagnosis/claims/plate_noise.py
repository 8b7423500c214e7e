"""The noise on the part against a plate's: compared where the part is hit squarely."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.evidence.noise_level import LevelChange, level_unsure, nats_since, scatter_of
from diagnosis.fields import Field, Mask
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel, robust_sd
from diagnosis.predict.albedo_borders import albedo_borders
from diagnosis.settings import SETTINGS
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.pixel_locking import PixelLocking
from sensors.view.covariates import COVARIATES
from sensors.view.view import View

WAYS = ("whitened", "scatter")
"""How the size of noise is measured."""


def level_change(
    ws: Workspace, model: Model, nominal_sd_mm: float, beside: Collection[str] = ()
) -> LevelChange:
    """Measure the part's noise over a nominal one.

    A finish is the same throughout, so the least change counts: of the recordings, of the ways to
    measure it, and of the parts of what other causes of noise follow, whose laws may be off
    elsewhere. Recordings that differ by more than their readings leave open say by how much a
    recording is unlike the finish for another reason.

    Parameters
    ----------
    beside : covariates that the noise goes with for other reasons
    """
    measured = levels(ws, model, nominal_sd_mm, beside).values()
    changes = [
        replace(c, unsure=math.hypot(c.unsure, scatter_of(each))) for each in measured for c in each
    ]
    logs = [c.log for c in changes]
    if not logs or min(logs) <= 0 <= max(logs):
        return LevelChange(log=0.0, unsure=level_unsure(ws.noise))
    return min(changes, key=lambda c: abs(c.log))


def change_since(
    ws: Workspace, model: Model, baseline: Workspace, usual: Mapping[str, Field], doubt: float,
    beside: Collection[str] = (),
) -> tuple[LevelChange, float]:  # fmt: skip
    """Measure the part's noise over that of baselines; and its log Bayes factor.

    The way to measure it and the part of what other causes follow that are the least evidence.

    Parameters
    ----------
    ws, baseline : with the same noise
    usual, doubt : as for `nats_since`
    beside : as for `level_change`
    """
    size_mm = ws.noise.sd_mm
    before = levels(baseline, Model(), size_mm)
    least = LevelChange(log=0.0, unsure=level_unsure(ws.noise)), -math.inf
    found = []
    for (way, *_), seen in levels(ws, model, size_mm, beside).items():
        good = before.get((way, "", 0), [])
        if good:
            log = float(np.mean([c.log for c in seen]) - np.mean([c.log for c in good]))
            change = LevelChange(log=log, unsure=float(np.mean([c.unsure for c in seen])))
            found.append((change, nats_since(seen, good, usual, doubt)))
    if not found or min(c.log for c, _ in found) <= 0 <= max(c.log for c, _ in found):
        return least
    return min(found, key=lambda f: f[1])


def levels(
    ws: Workspace, model: Model, nominal_sd_mm: float, beside: Collection[str] = ()
) -> dict[tuple[str, str, int], list[LevelChange]]:
    """Measure the noise of each recording over a nominal one.

    Where the part is bright and hit squarely, by the readings' scatter and by what neighbours leave
    of it: a wrong mean adds to the one, a wrong spectrum to the other.

    Parameters
    ----------
    beside : as for `level_change`

    Returns
    -------
    by way to measure it, covariate of the noise and part of its values: of each recording
    """
    predictions, plain = ws.predict(model), ws.predict(Model())
    # an effect has its own way to what the sensor's file may leave out
    goes_with = {name: COVARIATES[name].values for name in beside} | {
        e.covariate: e.covariate_values for e in model.effects if "variance" in e.channels
    }
    least, unchanged = SETTINGS.least_readings, SETTINGS.claims.unchanged
    square_rad = math.radians(SETTINGS.claims.square_deg)
    found: dict[tuple[int, str, int], list[tuple[Field, Field]]] = {}
    for patch, state, with_it, bare in zip(
        ws.patches, ws.states(predictions), predictions, plain, strict=True
    ):
        square = patch.view.incidence_rad < square_rad
        # where the model has the noise of a plate, effects on the noise have no say
        usual = np.abs(state.sd_mm / (model.level * ws.noise.sd_mm) - 1) < unchanged
        # where it leaves the mean alone, what it gets wrong there doesn't pass for noise
        still = np.abs(with_it.mean_mm - bare.mean_mm) < unchanged * ws.noise.sd_mm
        pick = patch.fit & state.used & ~patch.edge & square
        # light at borders of a print bends the mean, whatever the finish
        for calm in (usual, still, ~albedo_borders(patch.view)):
            if (pick & calm).sum() > least:
                pick &= calm
        bright = patch.view.intensity
        if bright is not None and pick.any():
            # dark print is noisier whatever its finish
            pick &= bright >= np.nanquantile(bright[pick], SETTINGS.claims.darker)
        size_mm = model.level * ws.noise.sd_mm
        for name, part, mask in _parts(patch, pick, goes_with):
            found.setdefault((patch.recording, name, part), []).append(
                (state.innovations[mask] * size_mm, state.residual_mm[mask])
            )
    changes: dict[tuple[str, str, int], list[LevelChange]] = {}
    for (_, name, part), values in found.items():
        for way, kind in zip(WAYS, zip(*values, strict=True), strict=True):
            each = np.concatenate(kind)
            if each.size > least:
                log = math.log(max(_scatter_mm(each), 1e-9) / nominal_sd_mm)
                unsure = level_unsure(
                    replace(ws.noise, readings=each.size), whitened=way == WAYS[0]
                )
                changes.setdefault((way, name, part), []).append(
                    LevelChange(log=log, unsure=unsure)
                )
    return changes


def levels_of_each(patches: Sequence[Patch], nominal: NoiseModel) -> list[LevelChange]:
    """Measure each recording's noise over a nominal one."""
    return [
        level_change(
            Workspace.build([p for p in patches if p.recording == k], nominal), Model(),
            nominal.sd_mm,
        )
        for k in sorted({p.recording for p in patches})
    ]  # fmt: skip


def _parts(
    patch: Patch, pick: Mask, covariates: Mapping[str, Callable[[View], Field]]
) -> Iterator[tuple[str, int, Mask]]:
    """Yield readings by what the noise goes with; all of them where that is nothing."""
    if not covariates or not pick.any():
        yield "", 0, pick
        return
    parts = SETTINGS.claims.level_parts
    for name, values_of in sorted(covariates.items()):
        values = np.broadcast_to(values_of(patch.view), patch.shape)
        ends = np.quantile(np.nan_to_num(values[pick]), np.arange(1, parts) / parts)
        part = np.searchsorted(ends, np.nan_to_num(values))
        for k in range(parts):
            yield name, k, pick & (part == k)


def _scatter_mm(values_mm: Field) -> float:
    """Return the standard deviation of values of which some are spikes, mm."""
    around = values_mm - np.median(values_mm)
    cap = 3 * robust_sd(values_mm)
    return float(np.sqrt(np.minimum(np.square(around), cap**2).mean() / 0.995))


def plates_doubt(model: Model, view: View) -> float:
    """By how much a plate's noise may be unlike the part's for no finish.

    A plate stands within one camera row or two, the part reaches over many; and it has none of the
    slopes on which a long exposure averages speckle in another way.
    """
    doubt = 0.0
    for effect in model.effects:
        if isinstance(effect, PixelLocking):
            doubt += 4 * math.pi * effect.amplitude_px
        elif isinstance(effect, MotionBlur):
            doubt -= math.log(effect.quieter(view))
    return doubt
