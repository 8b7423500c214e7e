"""Height maps in images: TIFF with one or more pages or with x, y, z channels, 16-bit PNG."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from files.budget import allow
from files.errors import RecipeError
from sensors.formats.clouds.cloud import Cloud, brightness, to_height_map
from sensors.formats.grids.arrays import from_array
from sensors.formats.grids.surface_topography import read_topography
from sensors.formats.height_map import HeightMap, scale_mm

PARK_TAG = 50434
"""Magic tag of Park Systems' TIFF."""
Page = NDArray[np.generic]


def read_tiff(path: Path, unit: str | None) -> HeightMap:
    """Read an image of heights, 8 to 32 bit or float; rows are profiles.

    A second page of the same size is brightness. Three channels of floats are x, y and z of each
    point (the layout of MVTec 3D-AD), missing points being zero.
    """
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            park = PARK_TAG in getattr(file.pages[0], "tags", ())
            for page in file.pages:
                allow("readings", math.prod(page.shape), where=path)
            pages = [] if park else [page.asarray() for page in file.pages]
    except RecipeError:
        raise
    except Exception as error:  # whatever a damaged file makes of the library
        raise RecipeError(f"isn't a TIFF image of heights ({error})", where=path) from None
    if park:  # the picture is a thumbnail, the heights stand in a tag
        return read_topography(path, unit)
    if not pages:
        raise RecipeError("holds no image", where=path)
    if pages[0].ndim == 3 and pages[0].shape[2] == 3 and pages[0].dtype.kind == "f":
        return _xyz(pages, unit, path)
    heights = from_array(pages[0], unit, path)
    if len(pages) == 1:
        return heights
    return _with_brightness(heights, pages, path)


def read_png(path: Path, unit: str | None) -> HeightMap:
    """Read an image of one channel, 8 or 16 bit; its counts are heights, rows are profiles."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            allow("readings", image.size[0] * image.size[1], where=path)
            if image.mode not in ("L", "I", "I;16", "I;16B", "F"):
                raise RecipeError(
                    "isn't an image of heights", where=path, value=image.mode,
                    allowed="one channel of 8 or 16 bit",
                )  # fmt: skip
            array = np.array(image)
    except (OSError, UnidentifiedImageError, SyntaxError, ValueError) as error:
        if isinstance(error, RecipeError):
            raise
        raise RecipeError(f"isn't a PNG image of heights ({error})", where=path) from None
    return from_array(array, unit, path)


def _xyz(pages: list[Page], unit: str | None, path: Path) -> HeightMap:
    grid = np.asarray(pages[0], dtype=np.float64)
    bright = pages[1] if len(pages) > 1 and pages[1].shape == grid.shape[:2] else None
    cloud = Cloud(
        points_mm=grid.reshape(-1, 3) * scale_mm(unit),
        shape=(grid.shape[0], grid.shape[1]),
        intensity=None if bright is None else brightness(np.asarray(bright, np.float64).ravel()),
    )

    found = to_height_map(cloud, path)
    words = ("three channels: x, y and z of each point",)
    return replace(found, unit_mm=scale_mm(unit), decisions=(*words, *found.decisions))


def _with_brightness(heights: HeightMap, pages: list[Page], path: Path) -> HeightMap:

    shape = heights.readings_mm.shape
    if len(pages) > 2 or pages[1].shape != shape:
        raise RecipeError(
            "holds several images that aren't a height and a brightness of one size", where=path,
            value=", ".join(str(page.shape) for page in pages[:4]),
        )  # fmt: skip
    values = np.asarray(pages[1], dtype=np.float64)
    full = 1.0
    if pages[1].dtype.kind in "iu":
        top = float(values.max(initial=0.0))
        full = next(f for f in (255.0, 1023.0, 4095.0, 65535.0, max(top, 1.0)) if top <= f)
    elif float(values.max(initial=0.0)) > 1.0:
        return replace(heights, intensity=brightness(values), decisions=("page 2 is brightness",))
    return replace(
        heights,
        intensity=np.clip(values, 0.0, full) / full,
        decisions=(
            *heights.decisions, f"page 1 is heights, page 2 brightness (full scale {full:g})"
        ),
    )
