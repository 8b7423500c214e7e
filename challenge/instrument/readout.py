"""From light on the chip to counts: glints, shot and read noise, blooming, conversion."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.coherent_image import FASTMATH


class Chip(NamedTuple):
    """From light to counts, and from counts to the line."""

    electrons: NDArray[np.float64]  # (columns,): of the whole line on the white plate
    ambient: NDArray[np.float64]  # (profiles, rows)
    full_well: float
    read_noise: float
    scale: float
    bloom: float
    kind: int
    threshold: float
    spikes: float
    quiet: bool  # no noise reaches the threshold: none is drawn for dark pixels


@njit(cache=True)
def spill(
    level: NDArray[np.float64], spilt: NDArray[np.float64], full_well: float, bloom: float
) -> None:
    """Clip full pixels; half of what is too much runs up the column, half down."""
    rows = level.size
    for r in range(rows):
        spilt[r] = max(level[r] - full_well, 0.0) * bloom * 0.5
        level[r] = min(level[r], full_well)
    for turn in range(2):
        carry = 0.0
        for k in range(rows):
            r = k if turn == 0 else rows - 1 - k
            taken = min(carry, full_well - level[r])
            level[r] += taken
            carry += spilt[r] - taken


@njit(cache=True, fastmath=FASTMATH)
def read_out(
    light: NDArray[np.float64],
    chip: Chip,
    profile: int,
    column: int,
    level: NDArray[np.float64],
    spilt: NDArray[np.float64],
    rng: np.random.Generator,
) -> None:
    """Fill (rows,) counts of one column: glints, shot and read noise, blooming, conversion."""
    rows = level.size
    stray_row, stray = -1, 0.0
    if chip.spikes > 0 and rng.random() < chip.spikes:
        stray_row = int(rng.random() * rows)
        stray = chip.full_well * (0.3 + 0.9 * rng.random())
    for r in range(rows):
        mean = light[column, r] * chip.electrons[column]
        if r == stray_row:
            mean += stray
        level[r] = chip.ambient[profile, r]
        if mean >= 1.0 or not chip.quiet:
            mean += level[r]
            noise = sqrt(mean + chip.read_noise * chip.read_noise)
            level[r] = mean + noise * rng.standard_normal()
    spill(level, spilt, chip.full_well, chip.bloom)
    for r in range(rows):
        level[r] = np.floor(level[r] * chip.scale + 0.5)
