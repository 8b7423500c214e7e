"""Files of microscopes and profilers that SurfaceTopography reads (extra `instruments`)."""

from pathlib import Path
from typing import Any

import numpy as np

from files.errors import RecipeError
from sensors.formats.height_map import HeightMap, scale_mm, unit_decision

SUFFIXES = (
    ".al3d", ".di", ".frt", ".hfm", ".ibw", ".jpk", ".mi", ".mnt", ".nc", ".nid", ".nms", ".opd",
    ".opdx", ".plu", ".plux", ".stp", ".tmd", ".top", ".vk3", ".vk4", ".vk6", ".zon", ".zmg",
)  # fmt: skip
WANTED = "pip install 'flawforge[instruments]'"


def read_topography(path: Path, unit: str | None) -> HeightMap:
    """Read the file's default height map; the file states units, `unit` overrides that of heights.

    Raises
    ------
    RecipeError
        Where SurfaceTopography isn't installed, or can't read the file.
    """
    try:
        from SurfaceTopography import open_topography
    except ImportError:
        raise RecipeError(
            "is of a format that needs the package SurfaceTopography", where=path, allowed=WANTED
        ) from None
    try:
        found = open_topography(str(path)).topography()
        return _height_map(found, unit)
    except RecipeError:
        raise
    except Exception as error:  # whatever a damaged file makes of the library
        words = " ".join(str(error).split())[:120]
        raise RecipeError(f"can't be read by SurfaceTopography ({words})", where=path) from None


def _height_map(found: Any, unit: str | None) -> HeightMap:
    held = found.unit
    scale = scale_mm(unit, held)
    lateral = scale_mm(None, held)
    heights = np.ma.filled(np.ma.asarray(found.heights(), dtype=np.float64), np.nan)
    words = (*unit_decision(unit, held), "read by SurfaceTopography, its default channel")
    if heights.ndim == 1:
        x = np.asarray(found.positions(), dtype=np.float64) * lateral
        return HeightMap(
            readings_mm=heights[None] * scale, x_mm=x, unit_mm=scale,
            unit_stated=held is not None, decisions=words,
        )  # fmt: skip
    columns, rows = heights.shape
    width, length = (float(size) * lateral for size in found.physical_sizes)
    return HeightMap(
        readings_mm=heights.T * scale,
        x_mm=np.arange(columns, dtype=np.float64) * (width / columns),
        y_mm=np.arange(rows, dtype=np.float64) * (length / rows),
        unit_mm=scale,
        unit_stated=held is not None,
        decisions=words,
    )
