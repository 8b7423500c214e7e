"""How well an instrument's error and a bent part imitate each other in one recording.

By rays and calibrations alone, without speckle: what a perfect observer could tell apart. A part
bends about its own sides: where it lies at an angle of 5° to the line, a medium bend differs by
some 3 standard deviations from any bow of the line.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from challenge.cases.case import SWITCHES, Staged
from challenge.cases.seeds import child
from challenge.cases.switches import World
from challenge.cases.truth import geometry, levelled

Floats = NDArray[np.float64]

IMITATES: dict[str, str] = {"line_bow": "warped_part", "warped_part": "line_bow"}
"""Faults, with the fault that imitates each."""
TOLD = 2.0
"""Standard deviations below which neither is told: odds of 7 at most."""
APART = 6
"""Readings whose speckle counts as one, as in a case's facts: 3 x 2 points."""


def told_apart(staged: Staged, name: str, noise_mm: float) -> float:
    """Tell by how many standard deviations a fault's best imitation differs in the last scan.

    Parameters
    ----------
    name
        Of the fault's switch.
    noise_mm
        Standard deviation of a reading.
    """
    off, index = staged.off, len(staged.off.scans.paths) - 1
    other = SWITCHES[IMITATES[name]].apply(off, 1, child(staged.seed, "imitation"))
    if other.device is not off.device:
        other = replace(other, device=other.device.calibrated(child(staged.seed, "calibration")))
    seen = geometry(off, off.scans.paths[index], off.scans.misplaced[index])
    plain, true, rival = (_read_mm(world, index) for world in (off, staged.on, other))
    return difference(true - plain, rival - plain, seen.smooth, seen.depth_mm, noise_mm)


def difference(
    true_mm: Floats, rival_mm: Floats, smooth: NDArray[np.bool_], depth_mm: Floats, noise_mm: float
) -> float:
    """Count the standard deviations between two changes (n, m) of the readings off edges.

    Of both, what a registration takes up is left out; the rival's size and sign are free.
    """
    true, rival = (levelled(change, smooth, depth_mm) for change in (true_mm, rival_mm))
    use = smooth & np.isfinite(true) & np.isfinite(rival)
    share = float(true[use] @ rival[use] / (rival[use] @ rival[use]))
    left = levelled(true - share * rival, use, depth_mm)[use]
    return float(np.sqrt(np.sum(left**2) / APART) / noise_mm)


def _read_mm(world: World, index: int) -> Floats:
    """Depths (n, m) that an instrument without noise reads of its part."""
    device = world.device
    assert device.calibration is not None
    seen = geometry(world, world.scans.paths[index], world.scans.misplaced[index])
    x = seen.depth_mm * np.tan(device.camera.angles_rad())
    row = device.camera.row_of(x, np.zeros_like(x), seen.depth_mm)
    return device.calibration.depth_mm(row)
