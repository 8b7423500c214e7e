"""Points x, y, z in tables of text: on a lattice, or in unrectified profiles."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from files.errors import RecipeError
from sensors.formats.clouds.cloud import Cloud, brightness, to_height_map
from sensors.formats.height_map import Floats, HeightMap, scale_mm, unit_decision
from sensors.formats.text.fan import from_profiles

LEAST_POINTS = 9  # points of a lattice
MIN_POINTS = 64  # rows from which three columns are points and no matrix


def points_map(
    table: Floats, units: list[str | None], unit: str | None, path: Path, bright: Floats | None
) -> HeightMap:
    """Read points: on a lattice, or in unrectified profiles."""
    one = next((held for held in units if held is not None), None)
    scales = np.array([scale_mm(unit, held or one) for held in units])
    points = table[:, :3] * scales
    words = unit_decision(unit, units[2] or one)
    cloud = Cloud(points_mm=points, intensity=None if bright is None else brightness(bright))
    try:
        found = to_height_map(cloud, path)
    except RecipeError as error:
        try:
            found = from_profiles(points, path)
        except RecipeError as other:
            raise other if "common fan" in str(other) else error from None
    stated = one is not None
    return replace(
        found, unit_mm=float(scales[2]), unit_stated=stated, decisions=(*words, *found.decisions)
    )


def are_points(table: Floats) -> bool:
    """Return whether columns run through a lattice, or stand in rows of one y."""
    at = table[:, :2]
    origin = (at == 0.0).all(axis=1)
    at = at[np.isfinite(at).all(axis=1) & ~(origin & (origin.sum() > 1))]
    if len(at) < LEAST_POINTS:
        return False
    columns, rows = np.unique(at[:, 0]).size, np.unique(at[:, 1]).size
    lattice = columns * rows <= (4 if len(at) >= MIN_POINTS else 1) * len(at)
    runs = 1 + int((np.diff(at[:, 1]) != 0).sum())
    profiles = runs == rows and len(at) >= 8 * rows
    return min(columns, rows) > 1 and (lattice or profiles)
