"""Files of instruments as height maps: one file a format, found by its suffix."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from files.budget import regular
from files.errors import RecipeError
from sensors.formats.clouds.geodata import read_e57, read_las
from sensors.formats.clouds.pcd import read_pcd
from sensors.formats.clouds.ply import read_ply
from sensors.formats.grids.arrays import read_npy
from sensors.formats.grids.bcr import read_bcr
from sensors.formats.grids.images import read_png, read_tiff
from sensors.formats.grids.sdf import read_sdf
from sensors.formats.grids.sick import read_sick
from sensors.formats.grids.spreadsheets import read_xlsx
from sensors.formats.grids.sur import read_sur
from sensors.formats.grids.surface_topography import SUFFIXES, read_topography
from sensors.formats.grids.x3p import read_x3p
from sensors.formats.height_map import HeightMap
from sensors.formats.text.decode import is_text
from sensors.formats.text.tables import read_csv


def read_dat(path: Path, unit: str | None) -> HeightMap:
    """Read a table of text, or a binary file that SurfaceTopography knows (MetroPro)."""
    with path.open("rb") as file:
        head = file.read(4096)
    return read_csv(path, unit) if is_text(head) else read_topography(path, unit)


READERS: Final[Mapping[str, Callable[[Path, str | None], HeightMap]]] = {
    ".csv": read_csv,
    ".txt": read_csv,
    ".asc": read_csv,
    ".xyz": read_csv,
    ".dat": read_dat,
    ".npy": read_npy,
    ".tif": read_tiff,
    ".tiff": read_tiff,
    ".png": read_png,
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".json": read_sick,
    ".x3p": read_x3p,
    ".sur": read_sur,
    ".xlsx": read_xlsx,
    ".sdf": read_sdf,
    ".bcr": read_bcr,
    ".bcrf": read_bcr,
    ".las": read_las,
    ".laz": read_las,
    ".e57": read_e57,
    **dict.fromkeys(SUFFIXES, read_topography),
}


def read_height_map(
    path: str | Path, unit: str | None = None, *, columns: Mapping[str, str] | None = None
) -> HeightMap:
    """Read an instrument's file; no reading is moved, averaged or filled.

    Parameters
    ----------
    path : path
        The file; its suffix determines the format.
    unit : str, optional
        Unit of the readings (of x, y and z in a point cloud); where it isn't given, the file's
        own, else mm.
    columns : mapping, optional
        What the named columns of a table of text hold (x, y, z, intensity, time, encoder);
        others are left out.

    Raises
    ------
    RecipeError
        Where the file is unreadable, or not of the format of its suffix.
    """
    path = Path(path)
    if path.suffix.lower() not in READERS:
        raise RecipeError("unknown format", where=path, allowed=", ".join(READERS))
    regular(path)
    if columns and READERS[path.suffix.lower()] is not read_csv:
        raise RecipeError("has no named columns", where=path, allowed="tables of text")
    try:
        if columns:
            return read_csv(path, unit, columns)
        with np.errstate(invalid="ignore", over="ignore"):  # of damaged numbers: NaN says it
            return READERS[path.suffix.lower()](path, unit)
    except (RecipeError, MemoryError):
        raise
    except OSError as error:
        raise RecipeError(f"can't be read ({error.strerror or error})", where=path) from None
    except Exception as error:  # a damaged file makes readers stumble over anything
        words = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        said = f"is damaged, or not what its suffix says ({words})"
        raise RecipeError(said, where=path) from None
