"""How readings were delivered: profiles twice, and steps coarser than the sensor's file states.

Both are certain where they are seen: readings have noise, so that neither repeats itself by chance.
A step is a fault where its rounding is larger than what good instruments depart by.
"""

import math
from collections.abc import Sequence

import numpy as np

from diagnosis.discrepancy.good_instrument import nats_of_size
from diagnosis.discrepancy.population import Population
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
    *,
    noise_mm: float,
    known: Population,
) -> list[FoundEffect]:
    """Name what the readings' own form shows, and note it.

    Parameters
    ----------
    noise_mm : standard deviation of the readings
    known : good instruments
    baselines : of the instrument when it was good: what they show, too, is no fault
    """
    found = [*_repeats(recordings, notes), *_steps(recordings, sheet, notes, noise_mm, known)]
    usual = set()
    if baselines:
        usual = {f.name for f in delivered(baselines, sheet, [], noise_mm=noise_mm, known=known)}
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
    recordings: Sequence[Recording],
    sheet: Datasheet,
    notes: list[str],
    noise_mm: float,
    known: Population,
) -> list[FoundEffect]:
    """Name a step of the depths that is coarser than stated; rounding by Δ scatters by Δ / √12."""
    step_um = coarse_step_um(recordings, sheet)
    if step_um is None:
        return []
    notes.append(
        f"depths come in steps of about {step_um:.3g} µm; the sensor's file states "
        f"{1e3 * sheet.step_mm:.3g} µm"
    )
    effect = AxisQuantisation(step_um=step_um)
    nats = nats_of_size(known, effect.name, 1e-3 * step_um / math.sqrt(12) / noise_mm)
    probability = SETTINGS.probability(nats, effect.name)
    if probability < SETTINGS.reported:
        notes.append(f"{effect.name}: next to the noise no more than good instruments have")
        return []
    found = {"step_um": Estimate(value=step_um)}
    return [plainly_found(effect, 0.0, found, probability=probability)]


def coarse_step_um(recordings: Sequence[Recording], sheet: Datasheet) -> float | None:
    """Measure the step of the depths; None where it isn't coarser than stated.

    Readings on a lattice take few values; their typical distance is the step, in the middle of the
    range where the lattice isn't even.
    """
    depth = np.concatenate([r.depth_mm[np.isfinite(r.depth_mm)] for r in recordings])
    if depth.size < SETTINGS.least_readings:
        return None
    values = np.unique(np.round(depth / sheet.step_mm).astype(np.int64))
    span = int(values[-1] - values[0])
    expected = min(depth.size, span) / 2
    if len(values) < SETTINGS.claims.least_steps or len(values) > expected:
        return None
    steps = float(np.median(np.diff(values)))
    return 1e3 * sheet.step_mm * steps if steps >= 2 else None
