"""Waves over the range: departures that repeat with the camera's rows, whatever the place.

All readings' scores are binned finely by the image row (by depth where the camera isn't known) and
transformed: one transform tests every period, the null's draws give its level.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.ndimage import median_filter, uniform_filter1d

from diagnosis.noise import Field, Mask
from diagnosis.patch import Patch
from diagnosis.score import CLIP, Whitened
from diagnosis.whitening import transposed
from sensors.view.camera import row_of_depth

BINS = 4096
LEAST_CYCLES = 8


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RangeWave:
    """The strongest wave over the range.

    Attributes
    ----------
    amplitude_mm : its size
    period : in mm of range at the middle of the readings
    """

    z: float
    gain: float
    amplitude_mm: float
    period_mm: float
    null: Field


def strongest_wave(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    masks: Sequence[Mask],
    drawn: Sequence[Field],
) -> RangeWave | None:
    """Test all periods at once.

    Parameters
    ----------
    drawn : for each patch (N, draws), null innovations at its picked readings
    """
    picked = [m & s.used for m, s in zip(masks, states, strict=True)]
    binned = _binned(patches, states, picked, drawn)
    if binned is None:
        return None
    sums, _ = binned
    power = np.abs(np.fft.rfft(sums, axis=0)) ** 2
    # periods no finer than two bins' worth of readings, no longer than an eighth of the span
    band = slice(LEAST_CYCLES, BINS // 3)
    level = uniform_filter1d(power[band, 1:].mean(axis=1), 15, mode="nearest")
    level = np.maximum(level, 1e-12)
    real, null = power[band, 0] / level, power[band, 1:] / level[:, None]
    scale = max(float(null.mean()), 1e-9)
    k = int(np.argmax(real))
    cycles = LEAST_CYCLES + k
    # information about a wave's amplitude under the null: its own variance
    amplitude = 2 * np.sqrt(power[band, 0][k]) / max(level[k], 1e-12)
    depth = np.concatenate([p.view.depth_mm[q] for p, q in zip(patches, picked, strict=True)])
    period = float(np.ptp(np.quantile(depth, [0.002, 0.998]))) / cycles
    return RangeWave(
        z=float(_deviate(real[k : k + 1] / scale)[0]),
        gain=float(real[k] / scale) - 1,
        amplitude_mm=float(amplitude) / 2,
        period_mm=period,
        null=_deviate((null / scale).max(axis=0)),
    )


def strongest_rows(
    patches: Sequence[Patch], states: Sequence[Whitened], masks: Sequence[Mask], count: int
) -> list[float]:
    """Numbers of camera rows over the working range with which the readings ripple most."""
    picked = [m & s.used for m, s in zip(masks, states, strict=True)]
    binned = _binned(patches, states, picked, [np.empty((0, 0))] * len(patches))
    if binned is None:
        return []
    sums, span = binned
    power = np.abs(np.fft.rfft(sums[:, 0])) ** 2
    above = power / np.maximum(median_filter(power, 31, mode="nearest"), 1e-12)
    found: list[int] = []
    for k in np.argsort(-above[LEAST_CYCLES : BINS // 3]) + LEAST_CYCLES:
        if len(found) == count:
            break
        if all(abs(k - other) > 1 for other in found):
            found.append(int(k))
    return [(k + part) / span for k in found for part in (-0.5, 0.0, 0.5)]


def _binned(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    picked: Sequence[Mask],
    drawn: Sequence[Field],
) -> tuple[Field, float] | None:
    """Sum the scores (BINS, 1 + draws) over the image's rows; the rows' span, 1 the whole range."""
    sheet = patches[0].view.datasheet
    known = sheet.triangulation_angle_deg is not None
    rows = [
        row_of_depth(p.view.depth_mm, sheet, 1.0) if known else p.view.depth_mm for p in patches
    ]
    every = np.concatenate([r[p] for r, p in zip(rows, picked, strict=True)])
    if every.size < 500 or np.ptp(every) == 0:
        return None
    low, high = np.quantile(every, [0.002, 0.998])
    draws = drawn[0].shape[1]
    sums = np.zeros((BINS, draws + 1))
    for patch, state, pick, row, null in zip(patches, states, picked, rows, drawn, strict=True):
        where = (row[pick] - low) / (high - low) * BINS
        inside = (where >= 0) & (where < BINS)
        index = where[inside].astype(np.int64)
        for d in range(draws + 1):
            values = np.clip(state.innovations[pick], -CLIP, CLIP) if d == 0 else null[:, d - 1]
            field = np.zeros(patch.shape)
            field[pick] = values
            score = (transposed(state.whitener, field) / state.sd_mm)[pick]
            sums[:, d] += np.bincount(index, weights=score[inside], minlength=BINS)
    return sums, float(high - low)


def _deviate(exponential: Field) -> Field:
    """Deviate of a unit exponential, the power of noise at one period."""
    tail = np.exp(-np.minimum(exponential, 600))
    return np.asarray(np.where(exponential < 600, stats.norm.isf(tail), np.sqrt(2 * exponential)))
