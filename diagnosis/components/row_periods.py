"""Periods over the range: at which the readings ripple most, whatever the place.

All readings' scores are binned finely by the image row and transformed: one transform looks at
every period.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from diagnosis.fields import Field, Mask
from diagnosis.noise.whitening import transposed
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.view.camera import row_of_depth

if TYPE_CHECKING:
    from diagnosis.data.patch import Patch
    from diagnosis.model.log_density import Whitened

BINS = 4096


def image_row(depth_mm: Field, sheet: Datasheet) -> Field:
    """Place of the line's image on the camera, 1 over the working range.

    By a usual triangulation angle where none is stated: rows grow with the range as by any other
    angle, to a sixth of that growth.
    """
    if sheet.triangulation_angle_deg is None:
        sheet = replace(sheet, triangulation_angle_deg=SETTINGS.assumed_angles_deg[1])
    return row_of_depth(depth_mm, sheet, 1.0)


def strongest_rows(
    patches: Sequence["Patch"], states: Sequence["Whitened"], masks: Sequence[Mask], count: int
) -> list[float]:
    """Numbers of camera rows over the working range with which the readings ripple most."""
    picked = [m & s.used for m, s in zip(masks, states, strict=True)]
    binned = _binned(patches, states, picked)
    if binned is None:
        return []
    sums, span = binned
    power = np.abs(np.fft.rfft(sums)) ** 2
    above = power / np.maximum(median_filter(power, 31, mode="nearest"), 1e-12)
    # what repeats has overtones, by which an overtone may be the strongest line
    reach = BINS // (3 * SETTINGS.harmonics)
    cycles = np.arange(reach)
    total = sum(above[h * cycles] / h for h in range(1, SETTINGS.harmonics + 1))
    found: list[int] = []
    least = SETTINGS.components.least_periods
    for k in np.argsort(-total[least:]) + least:
        if len(found) == count:
            break
        if all(abs(k - other) > 1 for other in found):
            found.append(int(k))
    return [(k + part) / span for k in found for part in (-0.5, 0.0, 0.5)]


def _binned(
    patches: Sequence["Patch"], states: Sequence["Whitened"], picked: Sequence[Mask]
) -> tuple[Field, float] | None:
    """Sum the scores (BINS,) over the image's rows; the rows' span, 1 the whole range."""
    rows = [image_row(p.view.depth_mm, p.view.datasheet) for p in patches]
    every = np.concatenate([r[p] for r, p in zip(rows, picked, strict=True)])
    if every.size < SETTINGS.components.period_readings or np.ptp(every) == 0:
        return None
    low, high = np.quantile(every, [0.002, 0.998])
    sums = np.zeros(BINS)
    for patch, state, pick, row in zip(patches, states, picked, rows, strict=True):
        where = (row[pick] - low) / (high - low) * BINS
        inside = (where >= 0) & (where < BINS)
        field = np.zeros(patch.shape)
        field[pick] = np.clip(state.innovations[pick], -SETTINGS.clip, SETTINGS.clip)
        score = (transposed(state.whitener, field) / state.sd_mm)[pick]
        index = where[inside].astype(np.int64)
        sums += np.bincount(index, weights=score[inside], minlength=BINS)
    return sums, float(high - low)
