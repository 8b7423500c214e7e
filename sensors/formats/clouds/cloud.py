"""Point clouds on a grid: which column and row each point belongs to.

A grid is found, never made: points off a grid are an error, since a reading moved onto one has
another noise.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats.height_map import Floats, HeightMap

OFF_GRID = 0.02  # of the pitch


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Cloud:
    """Points in mm; `shape` is rows × columns where the file keeps its points in order.

    `points_mm` is (n, 3), `intensity` (n,) from 0 to 1 or None.
    """

    points_mm: Floats
    shape: tuple[int, int] | None = None
    intensity: Floats | None = None
    note: str = ""


def to_height_map(cloud: Cloud, path: Path) -> HeightMap:
    """Return the heights on the cloud's own grid, rows along y, columns along x.

    Raises
    ------
    RecipeError
        Where the points form no grid.
    """
    if cloud.shape is not None and min(cloud.shape) > 1:
        return _organised(cloud, cloud.shape, path)
    return _lattice(cloud, path)


def brightness(values: Floats) -> Floats:
    """Return brightness as 0 to 1, from floats in that range or from 8- or 16-bit counts."""
    top = float(np.nanmax(values, initial=0.0))
    full = next((f for f in (1.0, 255.0, 65535.0) if top <= f), top)
    return np.clip(np.nan_to_num(values), 0.0, None) / full


def _organised(cloud: Cloud, shape: tuple[int, int], path: Path) -> HeightMap:
    grid = cloud.points_mm.reshape(*shape, 3).copy()
    bright = None if cloud.intensity is None else cloud.intensity.reshape(shape)
    missing = ~np.isfinite(grid).all(axis=2)
    zero = (grid == 0.0).all(axis=2)
    words: tuple[str, ...] = ()
    if zero.sum() > 1:  # the other way to mark a missing point
        missing |= zero
        words = (f"{int(zero.sum())} points at the origin are missing ones",)
    if missing.all():
        raise RecipeError("holds no point: all are missing", where=path)
    grid[missing] = np.nan
    x, y = grid[..., 0], grid[..., 1]
    if _spread(x, 0) > _spread(x, 1) and _spread(y, 1) > _spread(y, 0):
        grid = grid.transpose(1, 0, 2)
        bright = None if bright is None else bright.T
        x, y = grid[..., 0], grid[..., 1]
    return HeightMap(
        readings_mm=np.array(grid[..., 2]),
        x_mm=_shared(x, 0, "column", path),
        y_mm=_shared(y, 1, "row", path),
        intensity=bright,
        note=cloud.note,
        decisions=words,
    )


def _middle(values: Floats, axis: int) -> Floats:
    """Return the mid-range along an axis, NaN where there is no value."""
    low = np.where(np.isnan(values), np.inf, values).min(axis=axis)
    high = np.where(np.isnan(values), -np.inf, values).max(axis=axis)
    known = low <= high
    return np.where(known, (np.where(known, low, 0.0) + np.where(known, high, 0.0)) / 2, np.nan)


def _spread(values: Floats, axis: int) -> float:
    middle = np.expand_dims(_middle(values, axis), axis)
    return float(np.nanmax(np.abs(values - middle)))


def _shared(values: Floats, axis: int, noun: str, path: Path) -> Floats:
    """Return the place that all points of a column (or row) share; lines without points between."""
    places = _middle(values, axis)
    known = np.isfinite(places)
    index = np.arange(places.size)
    if known.sum() < 2:
        raise RecipeError(f"has points in fewer than 2 {noun}s", where=path)
    pitch = float(np.median(np.abs(np.diff(places[known]))))
    if not known.all():
        slope, offset = np.polyfit(index[known], places[known], 1)
        inside = (index >= index[known][0]) & (index <= index[known][-1])
        between = np.interp(index, index[known], places[known])
        places = np.where(known, places, np.where(inside, between, slope * index + offset))
    off = _spread(values, axis)
    rounding = 4.0 * float(np.finfo(np.float32).eps) * float(np.abs(places).max())
    if off > OFF_GRID * pitch + rounding:
        raise RecipeError(
            f"has {noun}s that aren't straight: points of one {noun} differ by {2 * off:.3g} mm at "
            f"a pitch of {pitch:.3g} mm (a fan of rays, or a turned cloud?); nothing is resampled",
            where=path,
        )
    return places


def _lattice(cloud: Cloud, path: Path) -> HeightMap:
    keep = np.isfinite(cloud.points_mm).all(axis=1)
    zero = (cloud.points_mm == 0.0).all(axis=1)
    words: tuple[str, ...] = ()
    if zero.sum() > 1:  # the other way to mark a missing point
        keep &= ~zero
        words = (f"{int(zero.sum())} points at the origin are missing ones",)
    points = cloud.points_mm[keep]
    if len(points) < 4:
        raise RecipeError("holds no grid of points", where=path, value=len(points))
    x_mm, column = _lines(points[:, 0])
    y_mm, row = _lines(points[:, 1])
    places = x_mm.size * y_mm.size
    if places > 4 * len(points) or min(x_mm.size, y_mm.size) < 2:
        raise RecipeError(
            f"holds {len(points)} points on no grid ({x_mm.size} different x, {y_mm.size} "
            "different y); nothing is resampled",
            where=path,
            allowed="points in rows and columns along x and y",
        )
    at = row * x_mm.size + column
    if np.unique(at).size != at.size:
        raise RecipeError("has two points in one place of its grid", where=path)
    readings = np.full(places, np.nan)
    readings[at] = points[:, 2]
    bright = np.zeros(places)
    if cloud.intensity is not None:
        bright[at] = cloud.intensity[keep]
    shape = y_mm.size, x_mm.size
    return HeightMap(
        readings_mm=readings.reshape(shape),
        x_mm=x_mm,
        y_mm=y_mm,
        intensity=None if cloud.intensity is None else bright.reshape(shape),
        note=cloud.note,
        decisions=words,
    )


def _lines(values: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Return the distinct values, apart from rounding, and which of them each value is."""
    eps = float(np.finfo(np.float32).eps)
    tolerance = max(4.0 * eps * float(np.abs(values).max()), 1e-7 * float(np.ptp(values)))
    distinct = np.unique(values)
    group = np.concatenate([[0], np.cumsum(np.diff(distinct) > tolerance)])
    first = np.concatenate([[True], np.diff(group) > 0])
    return distinct[first], group[np.searchsorted(distinct, values)]
