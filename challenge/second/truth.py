"""What a fault of the second family does, seen with other speckle: for the judge."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from challenge.cases.case import RECORDINGS, Secret
from challenge.cases.seeds import child, number
from challenge.cases.truth import DRAWS, Draws, Facts, facts_of
from challenge.second.case import Staged
from challenge.second.device import expected
from challenge.second.edges import off_edges
from challenge.second.world import World, placed

Floats = NDArray[np.float64]


def redraw(staged: Staged, secret: Secret, specimens: range) -> Draws:
    """Scan the held-out pose again with other specimens, with and without the fault."""
    last = secret.recordings - 1
    off = followed(staged.off, last, staged.on.device.exposure_s)
    mine, theirs = (
        np.stack([_shot(world, secret, last, number(secret.seed, "facts", str(d)))
                  for d in specimens])
        for world in (staged.on, off)
    )  # fmt: skip
    said = expected(off.device, off.solid, off.travels[last], off.misplaced[last])
    return Draws(with_it=mine, without=theirs, said_mm=said, smooth=off_edges(said))


def _shot(world: World, secret: Secret, index: int, specimen: int) -> Floats:
    """One scan; its robot, air and chip draw what the sealed recording's drew."""
    depth, _ = world.device.scan(
        world.solid, world.facets, world.travels[index],
        child(secret.seed, "noise", RECORDINGS[index]), specimen=specimen,
        misplaced=placed(world, index),
    )  # fmt: skip
    return depth


def facts(staged: Staged, secret: Secret, *, draws: int = DRAWS) -> Facts:
    """Tell what a fault does in the held-out pose, and how well it can be seen."""
    real = _shot(staged.on, secret, secret.recordings - 1, number(secret.seed, "specimen"))
    return facts_of(redraw(staged, secret, range(draws)), real)


def followed(world: World, index: int, exposure_s: float) -> World:
    """Place the part as the middle of such exposures sees it; see `challenge.cases.truth`."""
    travel = world.travels[index]
    later = 0.5 * (exposure_s - world.device.exposure_s)
    if later == 0:
        return world
    step = np.eye(4)
    step[:3, 3] = world.device.way * travel.pitch_mm * travel.rate_hz * later
    misplaced = list(world.misplaced)
    misplaced[index] = misplaced[index] @ travel.start @ step @ np.linalg.inv(travel.start)
    return replace(world, misplaced=tuple(misplaced))
