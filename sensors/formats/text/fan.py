"""Profiles of an unrectified instrument: each reading has an x of its own, along a fan of rays.

The rays of a fan meet in a point, so at height z column j lies at

    x_j(z) = a_j + (alpha + beta a_j) (z - z_m),

with a_j its place at the mean height z_m, -alpha / beta the emitter's x and 1/beta its height below
(or above) z_m. Readings are assigned to columns; none is moved.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats.height_map import Floats, HeightMap

Index = NDArray[np.int64]

ASTRAY = 0.25
"""Largest distance of a reading from its column, in pitches: with more, two columns could claim
it (at half a pitch) within twice the scatter."""
ROUNDS = 6


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Fan:
    """Columns' places at the mean height, and the law by which they move with height."""

    place: Floats
    alpha: float
    beta: float
    mean_z: float

    def at_mean(self, x: Floats, z: Floats) -> Floats:
        """Return where readings' rays cross the mean height."""
        return (x - self.alpha * (z - self.mean_z)) / (1 + self.beta * (z - self.mean_z))


def from_profiles(points_mm: Floats, path: Path) -> HeightMap:
    """Return the height map of points (n, 3) that stand in profiles of one y each.

    Raises
    ------
    RecipeError
        Where they stand in no profiles, or on no common fan.
    """
    points = points_mm[np.isfinite(points_mm).all(axis=1)]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(points[:, 1]) != 0.0]))
    y = points[starts, 1]
    if len(starts) < 2 or np.unique(y).size != y.size or len(points) < 8 * len(starts):
        raise RecipeError(
            "holds points that stand in no rows of one y; nothing is resampled", where=path
        )
    profiles = np.split(points, starts[1:])
    profiles = [part[np.argsort(part[:, 0])] for part in profiles]
    fan = _first_guess(profiles)
    x, z = points[:, 0], points[:, 2]
    row = np.repeat(np.arange(len(profiles)), [len(part) for part in profiles])
    x, z = (np.concatenate([part[:, k] for part in profiles]) for k in (0, 2))
    for _ in range(ROUNDS):
        column = _nearest(fan.place, fan.at_mean(x, z))
        fan = _fitted(x, z, column, len(fan.place), fan.mean_z)
    off = np.abs(fan.at_mean(x, z) - fan.place[column])
    pitch = float(np.median(np.diff(fan.place)))
    if np.quantile(off, 0.999) > ASTRAY * pitch:
        raise RecipeError(
            f"holds profiles on no common fan of rays: readings lie up to {off.max():.3g} mm from "
            f"their columns, {pitch:.3g} mm apart; nothing is resampled",
            where=path,
        )
    at = row * len(fan.place) + column
    if np.unique(at).size != at.size:
        raise RecipeError("has two readings of one profile on one ray", where=path)
    readings = np.full(len(profiles) * len(fan.place), np.nan)
    readings[at] = z
    slope = fan.alpha + fan.beta * fan.place
    return HeightMap(
        readings_mm=readings.reshape(len(profiles), -1),
        x_mm=fan.place - slope * fan.mean_z,
        y_mm=y,
        slope_x=slope,
        decisions=(
            f"each reading has its own x: {len(fan.place)} rays of a fan were found, readings lie "
            f"within {off.max():.2g} mm of them",
        ),
    )


def _first_guess(profiles: list[Floats]) -> _Fan:
    """Return the columns of the longest profile, standing still."""
    longest = max(profiles, key=len)
    place, mean_z = longest[:, 0].copy(), float(np.median(longest[:, 2]))
    # A fan opens evenly: two profiles at different heights tell by how much.
    alpha = beta = 0.0
    other = max(profiles, key=lambda part: abs(float(np.median(part[:, 2])) - mean_z))
    rise = float(np.median(other[:, 2])) - mean_z
    span, width = np.ptp(place), np.ptp(other[:, 0])
    if abs(rise) > 0 and len(other) == len(longest) and span > 0:
        beta = (width / span - 1) / rise
    place = (place - alpha * (longest[:, 2] - mean_z)) / (1 + beta * (longest[:, 2] - mean_z))
    return _Fan(place=_filled(np.sort(place)), alpha=alpha, beta=beta, mean_z=mean_z)


def _filled(place: Floats) -> Floats:
    """Insert the columns that are missing in a profile: whole steps between its readings."""
    steps = np.diff(place)
    pitch = float(np.median(steps))
    missing = np.maximum(np.rint(steps / pitch).astype(np.int64) - 1, 0)
    if not missing.any() or missing.sum() > len(place):
        return place
    parts = []
    for k, count in enumerate(missing):
        parts.append(np.linspace(place[k], place[k + 1], int(count) + 2)[:-1])
    return np.concatenate([*parts, place[-1:]])


def _nearest(place: Floats, x: Floats) -> Index:
    after = np.clip(np.searchsorted(place, x), 1, len(place) - 1)
    left = x - place[after - 1] < place[after] - x
    return np.asarray(after - left, dtype=np.int64)


def _fitted(x: Floats, z: Floats, column: Index, columns: int, mean_z: float) -> _Fan:
    """Fit places and the fan's law by least squares, each column's mean taken out."""
    count = np.maximum(np.bincount(column, minlength=columns), 1)

    def centred(values: Floats) -> tuple[Floats, Floats]:
        middle = np.bincount(column, values, columns) / count
        return values - middle[column], middle

    dx, mx = centred(x)
    dz, mz = centred(z - mean_z)
    alpha = beta = 0.0
    place = mx.copy()
    seen = np.bincount(column, minlength=columns) > 0
    for _ in range(4):
        design = np.stack([dz, place[column] * dz], axis=1)
        # Without relief nothing moves, and the least-norm answer is none.
        (alpha, beta), *_ = np.linalg.lstsq(design, dx, rcond=1e-9)
        place = (mx - alpha * mz) / (1 + beta * mz)
        known = np.flatnonzero(seen)
        place = np.interp(np.arange(columns), known, place[known])
    return _Fan(place=place, alpha=float(alpha), beta=float(beta), mean_z=mean_z)
