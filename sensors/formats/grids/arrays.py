"""Height maps in NPY arrays: a grid of numbers that states no pitch."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from files.budget import allow
from files.errors import RecipeError
from sensors.formats.height_map import HeightMap, scale_mm


def read_npy(path: Path, unit: str | None) -> HeightMap:
    """Read an array of profiles × points; integers are counts of one `unit`."""
    try:
        _check_header(path)
        array = np.load(path, allow_pickle=False)
    except RecipeError:
        raise
    except (OSError, ValueError, EOFError) as error:
        raise RecipeError(f"isn't an array of numbers ({error})", where=path) from None
    if not isinstance(array, np.ndarray):
        raise RecipeError("holds several arrays; save the heights alone", where=path)
    return from_array(array, unit, path)


def _check_header(path: Path) -> None:
    """Refuse an array that announces more than the file holds, before memory is asked for."""
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
        if version[0] not in read:
            return
        shape, _, dtype = read[version[0]](file)
        start = file.tell()
    count = math.prod(int(size) for size in shape)
    allow("readings", count, where=path)
    stored = path.stat().st_size - start
    if not dtype.hasobject and count * dtype.itemsize > stored:
        raise RecipeError(
            "ends early", where=path, value=f"{stored} bytes",
            allowed=f"{count * dtype.itemsize} as its header announces",
        )  # fmt: skip


def from_array(array: NDArray[np.generic], unit: str | None, path: Path) -> HeightMap:
    """Return a grid of numbers, a profile a row, as a height map; integers are counts."""
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
