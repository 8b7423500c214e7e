"""How readings were delivered: profiles twice, and steps coarser than the sensor's file states.

Both are certain where they are seen: readings have noise, so that neither repeats itself by chance.
"""

from collections.abc import Sequence

import numpy as np

from diagnosis.physics.uncertainty import Estimate
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect, plainly_found
from sensors.datasheet import Datasheet
from sensors.effects.axis_quantisation import AxisQuantisation
from sensors.effects.row_repeat import RowRepeat
from sensors.recording import Recording, repeated_rows


def delivered(
    recordings: Sequence[Recording],
    sheet: Datasheet,
    notes: list[str],
    baselines: Sequence[Recording] = (),
) -> list[FoundEffect]:
    """Name what the readings' own form shows, and note it.

    Parameters
    ----------
    baselines : of the instrument when it was good: what they show, too, is no fault
    """
    found = [*_repeats(recordings, notes), *_steps(recordings, sheet, notes)]
    usual = {f.name for f in delivered(baselines, sheet, [])} if baselines else set()
    notes += [f"{f.name}: the baselines have it, too" for f in found if f.name in usual]
    return [f for f in found if f.name not in usual]


def _repeats(recordings: Sequence[Recording], notes: list[str]) -> list[FoundEffect]:
    shares = []
    for r in recordings:
        count = int(repeated_rows(r.depth_mm).sum())
        if count:
            notes.append(
                f"{r.name}: {count} of {len(r.depth_mm)} profiles repeat the one before, "
                "reading for reading; they measured nothing and are left out"
            )
        shares.append(count / len(r.depth_mm))
    share = float(np.mean(shares))
    if share < SETTINGS.claims.repeats:
        return []
    effect = RowRepeat(share=min(share, RowRepeat.parameter("share").high))
    return [plainly_found(effect, 0.0, {"share": Estimate(value=share)}, probability=1.0)]


def _steps(
    recordings: Sequence[Recording], sheet: Datasheet, notes: list[str]
) -> list[FoundEffect]:
    """Find the step of the depths where it is coarser than stated.

    Readings on a lattice take few values; their typical distance is the step, in the middle of the
    range where the lattice isn't even.
    """
    depth = np.concatenate([r.depth_mm[np.isfinite(r.depth_mm)] for r in recordings])
    if depth.size < SETTINGS.least_readings:
        return []
    values = np.unique(np.round(depth / sheet.step_mm).astype(np.int64))
    span = int(values[-1] - values[0])
    expected = min(depth.size, span) / 2
    if len(values) < SETTINGS.claims.least_steps or len(values) > expected:
        return []
    step_um = 1e3 * sheet.step_mm * float(np.median(np.diff(values)))
    if step_um < 2e3 * sheet.step_mm:
        return []
    notes.append(
        f"depths come in steps of about {step_um:.3g} µm; the sensor's file states "
        f"{1e3 * sheet.step_mm:.3g} µm"
    )
    effect = AxisQuantisation(step_um=step_um)
    return [plainly_found(effect, 0.0, {"step_um": Estimate(value=step_um)}, probability=1.0)]
