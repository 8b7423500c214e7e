"""Height maps in NPY arrays and TIFF images: a grid of numbers, with no word about its pitch."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sensors.formats.height_map import HeightMap, scale_mm
from sensors.typed_yaml import RecipeError


def read_npy(path: Path, unit: str | None) -> HeightMap:
    """Read an array of profiles × points; integers are counts of one `unit`."""
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise RecipeError(f"isn't an array of numbers ({error})", where=path) from None
    if not isinstance(array, np.ndarray):
        raise RecipeError("holds several arrays; save the heights alone", where=path)
    return _from_array(array, unit, path)


def read_tiff(path: Path, unit: str | None) -> HeightMap:
    """Read an image of heights with one channel, 8 to 32 bit or float; rows are profiles."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            pages = getattr(image, "n_frames", 1)
            array = np.array(image)
    except (OSError, UnidentifiedImageError, SyntaxError, ValueError) as error:
        raise RecipeError(f"isn't a TIFF image of heights ({error})", where=path) from None
    if pages != 1:
        raise RecipeError("holds several images", where=path, value=pages, allowed="one")
    return _from_array(array, unit, path)


def _from_array(array: NDArray[np.generic], unit: str | None, path: Path) -> HeightMap:
    if array.ndim == 1:  # one profile
        array = array[None]
    if array.dtype.kind not in "fiu" or array.ndim != 2:
        raise RecipeError(
            "isn't a grid of heights",
            where=path,
            value=f"{array.dtype} {array.shape}",
            allowed="real numbers, rows × columns",
        )
    scale = scale_mm(unit)
    return HeightMap(
        readings_mm=np.asarray(array, dtype=np.float64) * scale,
        step_mm=None if array.dtype.kind == "f" else scale,
        unit_mm=scale,
    )
