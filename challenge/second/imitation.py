"""How well a fault of the second family and its rival imitate each other in one recording."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from challenge.cases.imitation import difference
from challenge.cases.seeds import child
from challenge.second.case import Staged, calibrated
from challenge.second.device import expected
from challenge.second.edges import off_edges
from challenge.second.switches import FAULTS
from challenge.second.world import World

Floats = NDArray[np.float64]

IMITATES: dict[str, str] = {
    "bowed calibration plate": "sagged part",
    "sagged part": "bowed calibration plate",
}
"""Faults, with the fault that imitates each."""


def told_apart(staged: Staged, name: str, index: int, noise_mm: float) -> float:
    """Tell by how many standard deviations a fault's best imitation differs in a scan.

    Parameters
    ----------
    name
        Of the fault.
    index
        Of the scan.
    noise_mm
        Standard deviation of a reading.
    """
    off = staged.off
    bare = replace(off, device=replace(off.device, calibration=None))
    other = FAULTS[IMITATES[name]].apply(bare, 1.0, child(off.seed, "imitation"))
    other = calibrated(other, off.seed)
    seen = expected(off.device, off.solid, off.travels[index], off.misplaced[index])
    plain, true, rival = (_read_mm(world, index) for world in (off, staged.on, other))
    return difference(true - plain, rival - plain, off_edges(seen), seen, noise_mm)


def _read_mm(world: World, index: int) -> Floats:
    """Depths (n, m) on even x that an instrument without noise reads of its part."""
    device = world.device
    depth = expected(device, world.solid, world.travels[index], world.misplaced[index])
    x = device.camera.even_mm
    row = device.camera.row_of(x, np.zeros_like(x), depth - device.distance_mm)
    return device.depths_at(x, row)
