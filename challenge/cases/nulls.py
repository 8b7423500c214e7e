"""Nulls, verified: over many specimens the readings' mean is what the maker's file says."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from challenge.cases.case import MAKES, Secret, Staged, scan
from challenge.cases.devices import Scans
from challenge.cases.seeds import child, number
from challenge.cases.stated import Rays, stated
from challenge.cases.truth import geometry
from challenge.instrument.instrument import Casts

NULL_DRAWS = 100
NULL_LIMIT = 0.1  # of the noise's standard deviation, off edges
LOST_LIMIT = 0.005  # share of points off edges that return against the file, or do not
EDGE_LIMIT = 1.0  # mean departure at edges over the noise's deviation
EDGE_LOST_LIMIT = 0.05  # share of points at edges that return against the file, or do not
_CUT = 10.0  # a departure at an edge counts at most so many σ: the wrong level is the wrong level
_PROFILES = 4


@dataclass(frozen=True, kw_only=True, slots=True)
class NullCheck:
    """How far a null's mean readings are from its file.

    Attributes
    ----------
    departure
        Off edges: largest block mean over σ, offset removed, less three standard errors.
    lost
        Off edges: share of points whose probability of a return differs by more than 0.5.
    edge_departure, edge_lost
        The same at edges: mean of the absolute departure over σ, each counting 10 at most, what
        the draws' own number leaves in it included; share of points.
    edge_share
        Share of the verified points at edges that are at edges.
    noise_um
        σ off edges.
    """

    departure: float
    lost: float
    edge_departure: float
    edge_lost: float
    edge_share: float
    noise_um: float

    @property
    def holds_off_edges(self) -> bool:
        """The bounds off edges are kept: all that a file of nominal widths promises."""
        return self.departure < NULL_LIMIT and self.lost < LOST_LIMIT

    @property
    def holds(self) -> bool:
        """All four bounds are kept."""
        return (
            self.holds_off_edges
            and self.edge_departure < EDGE_LIMIT
            and self.edge_lost < EDGE_LOST_LIMIT
        )

    def holds_in(self, family: str) -> bool:
        """Whether it is a null in a family: at edges nominal figures promise nothing."""
        return self.holds_off_edges if family == MAKES else self.holds


def check_null(staged: Staged, secret: Secret) -> NullCheck:
    """Scan strips of a null's recordings with `NULL_DRAWS` other specimens.

    In each recording the strip of four profiles with the fewest points near edges and the one
    with the most are taken. Off edges (four line spreads and two profiles, or three columns)
    means are taken over blocks of 24 columns, at edges by point.
    """
    worst, sigma, lost, smooth_points = 0.0, 0.0, 0, 0
    rests: list[NDArray[np.float64]] = []
    wrong: list[NDArray[np.bool_]] = []
    world = staged.on
    for k in range(secret.recordings):
        path, misplaced = world.scans.paths[k], world.scans.misplaced[k]
        smooth = geometry(world, path, misplaced).smooth
        starts = range(8, path.profiles - _PROFILES - 8, 4)
        clean = [int(smooth[i : i + _PROFILES].sum()) for i in starts]
        level, spread = 0.0, 0.0
        for first in (starts[int(np.argmax(clean))], starts[int(np.argmin(clean))]):
            rows = slice(first, first + _PROFILES)
            rays = Rays(world.solid, path, misplaced, world.device.camera,
                        world.device.z_range_mm, rows=rows)  # fmt: skip
            said = stated(rays, staged.effects).depth_mm
            shots = _strip(staged, secret, k, first)
            flat, seen = smooth[rows], np.isfinite(shots).mean(0)
            differs = np.abs(seen - np.isfinite(said)) > 0.5
            if not spread:  # the clean strip comes first: it gives level and noise
                off = shots - said
                off[:, ~flat] = np.nan
                if np.isfinite(off).sum() < 50 * NULL_DRAWS:
                    break
                level = float(np.nanmean(off))
                spread = float(np.sqrt(np.nanmean(_centred(off) ** 2)))
                sigma = max(sigma, spread)
                worst = max(worst, _blocks(off, flat, level, spread))
            lost += int((differs & flat).sum())
            smooth_points += int(flat.sum())
            both = ~flat & np.isfinite(said) & (seen > 0.5)
            mean = np.nansum(shots, 0) / np.maximum(np.isfinite(shots).sum(0), 1)
            rests.append((np.abs(mean - said - level) / spread)[both])
            wrong.append(differs[~flat])
    rest = np.concatenate([*rests, np.zeros(0)])
    told = np.concatenate([*wrong, np.zeros(0, bool)])
    return NullCheck(
        departure=worst,
        lost=lost / max(smooth_points, 1),
        edge_departure=float(np.minimum(rest, _CUT).mean()) if rest.size else 0.0,
        edge_lost=float(told.mean()) if told.size else 0.0,
        edge_share=told.size / max(told.size + smooth_points, 1),
        noise_um=1e3 * sigma,
    )


def _strip(staged: Staged, secret: Secret, index: int, first: int) -> NDArray[np.float64]:
    """Scan a few profiles of one recording again and again, (draws, profiles, columns)."""
    world = staged.on
    path = world.scans.paths[index]
    start = path.start.copy()
    start[:3, 3] += first * path.direction * path.pitch_mm * start[:3, 1]
    short = replace(path, start=start, profiles=_PROFILES)
    scans = Scans(paths=(short,), misplaced=(world.scans.misplaced[index],))
    casts: Casts = {}
    name = (str(index), str(first))
    return np.stack(
        [
            scan(
                world, scans, 0,
                specimen=number(secret.seed, "null", *name, str(d)),
                rng=child(secret.seed, "null noise", *name, str(d)),
                casts=casts,
            )[0]
            for d in range(NULL_DRAWS)
        ]
    ).astype(np.float64)  # fmt: skip


def _centred(shots_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take the draws' mean away."""
    count = np.isfinite(shots_mm).sum(0)
    return np.asarray(shots_mm - np.nansum(shots_mm, 0) / np.maximum(count, 1))


def _blocks(
    off: NDArray[np.float64], flat: NDArray[np.bool_], level: float, spread: float
) -> float:
    """Largest mean of a block of columns over σ, less three standard errors."""
    worst = 0.0
    for c in range(0, flat.shape[1] - 23, 24):
        if flat[:, c : c + 24].sum() < 48:
            continue
        each = np.nanmean(off[:, :, c : c + 24], axis=(1, 2))
        error = float(each.std()) / np.sqrt(len(each))
        worst = max(worst, (abs(float(each.mean()) - level) - 3 * error) / spread)
    return worst
