"""Brightness of a part's surface over its own x-y plane, as a recipe describes it."""

import functools
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from files.record import record
from quantity import quantity

Floats = NDArray[np.float64]


@record
class Stripes:
    """Stripes across an axis of the part; their brightness replaces what lies below.

    A stripe covers `duty` of each `period_mm`, the first from `start_mm`.
    """

    value: float = quantity("reflectance of the stripes", low=0, high=1)
    period_mm: float = quantity("distance from stripe to stripe", unit="mm", low=0, above=True)
    across: Literal["x", "y"] = "y"
    duty: float = quantity("share of the period", low=0, high=1, default=0.5)
    start_mm: float = 0.0


@record
class Patch:
    """A rectangle of the part's x-y plane with a reflectance."""

    value: float = quantity("reflectance of the patch", low=0, high=1)
    x_mm: tuple[float, float]
    y_mm: tuple[float, float]


@record
class Picture:
    """A grey picture laid over a rectangle of the part's x-y plane, its first row at the far y.

    PNG (any grey or colour, taken as its mean) or NPY (0 to 1); linear between pixels.
    """

    path: str
    x_mm: tuple[float, float]
    y_mm: tuple[float, float]


@record
class ReflectanceMap:
    """Reflectance of a part, 0 to 1: a base, then a picture, stripes and patches over it.

    Looked up at a point's x and y, so that both faces of a plate have it.
    """

    base: float = quantity("reflectance under all else", low=0, high=1, default=1.0)
    picture: Picture | None = None
    stripes: tuple[Stripes, ...] = ()
    patches: tuple[Patch, ...] = ()

    @property
    def cell_mm(self) -> float:
        """Side of cells within which a border's place isn't known: none, it is described."""
        return 0.0

    def at(self, part_mm: Floats) -> Floats:
        """Return the reflectance (...,) at points (..., 3), part frame, mm; NaN where they are.

        Raises
        ------
        RecipeError
            Where the picture can't be read.
        """
        x, y = part_mm[..., 0], part_mm[..., 1]
        value = np.where(np.isnan(x), np.nan, self.base)
        if self.picture is not None:
            value = _look_up(self.picture, x, y, value)
        for stripes in self.stripes:
            place = (y if stripes.across == "y" else x) - stripes.start_mm
            inside = np.mod(place, stripes.period_mm) < stripes.duty * stripes.period_mm
            value = np.where(inside, stripes.value, value)
        for patch in self.patches:
            inside = (x >= patch.x_mm[0]) & (x < patch.x_mm[1])
            inside &= (y >= patch.y_mm[0]) & (y < patch.y_mm[1])
            value = np.where(inside, patch.value, value)
        return np.asarray(value)


def _look_up(picture: Picture, x: Floats, y: Floats, value: Floats) -> Floats:
    grey = _read(picture.path)
    rows, columns = grey.shape
    u = (x - picture.x_mm[0]) / (picture.x_mm[1] - picture.x_mm[0])
    v = (picture.y_mm[1] - y) / (picture.y_mm[1] - picture.y_mm[0])
    inside = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
    column = np.clip(np.where(inside, u, 0.0) * columns - 0.5, 0, columns - 1)
    row = np.clip(np.where(inside, v, 0.0) * rows - 0.5, 0, rows - 1)
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    right, below = np.minimum(left + 1, columns - 1), np.minimum(top + 1, rows - 1)
    s, t = column - left, row - top
    upper = (1 - s) * grey[top, left] + s * grey[top, right]
    lower = (1 - s) * grey[below, left] + s * grey[below, right]
    return np.where(inside, (1 - t) * upper + t * lower, value)


@functools.lru_cache(maxsize=4)
def _read(path: str) -> Floats:
    try:
        if Path(path).suffix.lower() == ".npy":
            grey = np.load(path, allow_pickle=False).astype(np.float64)
        else:
            from matplotlib.image import imread

            pixels = imread(path)
            grey = pixels.astype(np.float64) / (255.0 if pixels.dtype == np.uint8 else 1.0)
    except (OSError, ValueError, SyntaxError) as error:
        raise RecipeError(f"can't be read as a picture ({error})", where=path) from None
    if grey.ndim == 3:
        grey = grey[..., :3].mean(axis=-1)
    if grey.ndim != 2 or grey.size == 0 or not ((grey >= 0) & (grey <= 1)).all():
        raise RecipeError("isn't a grey picture with values from 0 to 1", where=path)
    return np.asarray(grey)
