"""Point clouds of surveying: LAS and LAZ through laspy, E57 through pye57 (extra `instruments`)."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from files.errors import RecipeError
from sensors.formats.clouds.cloud import Cloud, brightness, to_height_map
from sensors.formats.grids.surface_topography import WANTED
from sensors.formats.height_map import Floats, HeightMap, scale_mm


def read_las(path: Path, unit: str | None) -> HeightMap:
    """Read points on a grid; the format states no unit, metres by custom."""
    try:
        import laspy
    except ImportError:
        raise RecipeError(
            "is of a format that needs the package laspy", where=path, allowed=WANTED
        ) from None
    try:
        cloud = laspy.read(path)
        points = np.stack([np.asarray(cloud[axis], np.float64) for axis in "xyz"], axis=1)
        bright = np.asarray(cloud.intensity, np.float64)
    except Exception as error:  # whatever a damaged file makes of the library
        raise RecipeError(f"can't be read by laspy ({error})", where=path) from None
    return _on_grid(points, bright, unit, path)


def read_e57(path: Path, unit: str | None) -> HeightMap:
    """Read the first scan's points on a grid; metres by the standard (ASTM E2807)."""
    try:
        import pye57
    except ImportError:
        raise RecipeError(
            "is of a format that needs the package pye57", where=path, allowed=WANTED
        ) from None
    try:
        data = pye57.E57(str(path)).read_scan(0, ignore_missing_fields=True)
        points = np.stack([data[f"cartesian{axis}"] for axis in "XYZ"], axis=1).astype(np.float64)
        bright = data.get("intensity")
    except Exception as error:  # whatever a damaged file makes of the library
        raise RecipeError(f"can't be read by pye57 ({error})", where=path) from None
    values = None if bright is None else np.asarray(bright, np.float64)
    return _on_grid(points, values, unit, path)


def _on_grid(
    points: Floats, bright: Floats | None, unit: str | None, path: Path
) -> HeightMap:
    dark = bright is None or not bright.any()
    cloud = Cloud(
        points_mm=points * scale_mm(unit, "m"),
        intensity=None if dark or bright is None else brightness(bright),
    )
    found = to_height_map(cloud, path)
    words = () if unit else ("lengths are in m, by the format's custom",)
    return replace(found, unit_stated=True, decisions=(*words, *found.decisions))
