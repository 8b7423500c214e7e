"""Speckle: every surface cell scatters with its own random phase, fixed to the part."""

from math import pi

import numpy as np
from numba import njit
from numpy.typing import NDArray

CELL_MM = 1e-3


@njit(cache=True)
def mixed(value: np.uint64) -> np.uint64:
    """Scatter the bits of a 64-bit number (the finaliser of splitmix64)."""
    value ^= value >> np.uint64(30)
    value *= np.uint64(0xBF58476D1CE4E5B9)
    value ^= value >> np.uint64(27)
    value *= np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


@njit(cache=True)
def phases(
    part_mm: NDArray[np.float64], seed: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Cosine and sine of the scattering phase at surface points.

    Parameters
    ----------
    part_mm : (n, 3)
        Points in the part frame; points of one cell of a micrometre share a phase.
    seed : int
        Another seed is another specimen of the same surface.

    Returns
    -------
    cosine, sine : (n,)
    """
    count = part_mm.shape[0]
    cosine = np.empty(count, np.float32)
    sine = np.empty(count, np.float32)
    start = mixed(np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15))
    for i in range(count):
        code = start
        for axis in range(3):
            cell = np.int64(np.floor(part_mm[i, axis] / CELL_MM))
            code = mixed(code ^ (np.uint64(cell) * np.uint64(0x9E3779B97F4A7C15)))
        angle = 2 * pi * (np.float64(code >> np.uint64(11)) / 9007199254740992.0)
        cosine[i] = np.cos(angle)
        sine[i] = np.sin(angle)
    return cosine, sine
