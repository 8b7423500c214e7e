"""Whether a null of the second family is one: it departs no more than its baselines do."""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from challenge.cases.case import BASELINES, RECORDINGS, Secret
from challenge.cases.nulls import NULL_LIMIT
from challenge.cases.seeds import child, number
from challenge.cases.truth import levelled
from challenge.second.case import Staged
from challenge.second.device import expected
from challenge.second.edges import off_edges
from challenge.second.world import World

Floats = NDArray[np.float64]
BLOCK = 12, 24
"""Profiles and columns of a block whose mean is looked at."""
FACTOR, SLACK_SD, SLACK_LOST = 1.5, 0.1, 0.005
"""A null's departure: at most so many times that of the worse baseline, and that much more."""
DRAWS = 12
"""Other specimens of a null that its systematic departure is the mean of."""
LEAST_BLOCKS = 8
"""Fewer blocks off edges show no departure: such a part makes no null."""
_LEAST = 0.4  # share of a block that must be off edges


@dataclass(frozen=True, kw_only=True, slots=True)
class Check:
    """What a null's recordings and its baselines show off edges.

    Attributes
    ----------
    departure_sd, baseline_sd
        95 % quantile of block means against the mesh, in noise standard deviations.
    lost, baseline_lost
        Share of readings that are missing there.
    blocks
        Off edges in the recording that has the fewest.
    systematic_sd
        Largest block mean against the mesh over `DRAWS` other specimens of the last recording, less
        three standard errors, what a registration takes up removed: what no noise explains.
    """

    departure_sd: float
    baseline_sd: float
    lost: float
    baseline_lost: float
    blocks: int
    systematic_sd: float

    @property
    def holds(self) -> bool:
        """The recordings stay within what the baselines show, where there is something to see."""
        return (
            self.blocks >= LEAST_BLOCKS
            and self.systematic_sd < NULL_LIMIT
            and self.departure_sd <= FACTOR * self.baseline_sd + SLACK_SD
            and self.lost <= FACTOR * self.baseline_lost + SLACK_LOST
        )


def check_null(secret: Secret, staged: Staged, folder: Path) -> Check:
    """Hold the recordings in a case's folder, and its baselines, against the mesh."""
    count = secret.recordings
    mine = [_seen(staged.on, k, folder / f"{n}.h5") for k, n in enumerate(RECORDINGS[:count])]
    good = [_seen(staged.off, count + k, folder / f"{n}.h5") for k, n in enumerate(BASELINES)]
    return Check(
        departure_sd=max(d for d, _, _ in mine), baseline_sd=max(d for d, _, _ in good),
        lost=max(m for _, m, _ in mine), baseline_lost=max(m for _, m, _ in good),
        blocks=min(n for _, _, n in (*mine, *good)),
        systematic_sd=systematic(secret, staged.on),
    )  # fmt: skip


def systematic(secret: Secret, world: World) -> float:
    """Largest block mean of the last recording over many specimens; see `Check`."""
    last = secret.recordings - 1
    travel, place = world.travels[last], world.misplaced[last]
    truth = expected(world.device, world.solid, travel, place)
    smooth = off_edges(truth)
    shots = np.stack([
        world.device.scan(
            world.solid, world.facets, travel, child(secret.seed, "null noise", str(d)),
            specimen=number(secret.seed, "null", str(d)), misplaced=place,
        )[0]
        for d in range(DRAWS)
    ])  # fmt: skip
    seen = np.isfinite(shots).sum(0)
    mean = np.where(seen > DRAWS / 2, np.nansum(shots, 0) / np.maximum(seen, 1), np.nan)
    if not (smooth & np.isfinite(mean)).any():
        return float("nan")
    rest = levelled(mean - truth, smooth, truth)
    sd = 1.4826 * float(np.nanmedian(np.abs(shots - mean)[:, smooth]))
    worst = 0.0
    for place_of in _blocks(np.where(smooth, rest, np.nan)):
        each = [float(np.nanmean(s)) for s in (shots - mean)[:, *place_of]]
        error = float(np.nanstd(each)) / np.sqrt(DRAWS)
        block = float(np.nanmean(np.where(smooth, rest, np.nan)[place_of]))
        worst = max(worst, (abs(block) - 3 * error) / sd)
    return worst


def _blocks(values: Floats) -> list[tuple[slice, slice]]:
    """Blocks most of which has values."""
    found = []
    for i in range(0, values.shape[0] - BLOCK[0] + 1, BLOCK[0]):
        for j in range(0, values.shape[1] - BLOCK[1] + 1, BLOCK[1]):
            at = slice(i, i + BLOCK[0]), slice(j, j + BLOCK[1])
            if np.isfinite(values[at]).mean() > _LEAST:
                found.append(at)
    return found


def _seen(world: World, index: int, file: Path) -> tuple[float, float, int]:
    with h5py.File(file) as stored:
        depth = np.asarray(stored["depth"], np.float64)
    truth = expected(world.device, world.solid, world.travels[index], world.misplaced[index])
    return departure(depth, truth)


def departure(depth_mm: Floats, truth_mm: Floats) -> tuple[float, float, int]:
    """Departure of block means off edges in standard deviations, share missing, and blocks."""
    smooth = off_edges(truth_mm)
    rest = np.where(smooth, depth_mm - truth_mm, np.nan)
    if not np.isfinite(rest).any():
        return 0.0, 0.0, 0
    centred = rest - np.nanmedian(rest)
    sd = 1.4826 * float(np.nanmedian(np.abs(centred)))
    means = [abs(float(np.nanmean(centred[at]))) / sd for at in _blocks(centred)]
    missing = float(np.isnan(depth_mm)[smooth].mean()) if smooth.any() else 0.0
    return (float(np.quantile(means, 0.95)) if means else 0.0), missing, len(means)
