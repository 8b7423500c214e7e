"""Height maps in NPY arrays and in TIFF images: a grid of numbers, nothing about pitch."""

from pathlib import Path

import numpy as np

from sensors.formats.height_map import HeightMap, scale_mm
from sensors.typed_yaml import RecipeError


def read_npy(path: Path, unit: str | None) -> HeightMap:
    """Read an array of rows × columns, in `unit`."""
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise RecipeError(f"isn't an array of numbers ({error})", where=path) from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        raise RecipeError("isn't one array of numbers", where=path)
    step = None if array.dtype.kind == "f" else scale_mm(unit)
    return HeightMap(readings_mm=np.asarray(array, dtype=np.float64) * scale_mm(unit), step_mm=step)
