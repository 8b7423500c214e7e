"""Files of instruments as height maps: one file a format, found by its suffix."""

from pathlib import Path

from sensors.formats.arrays import read_npy
from sensors.formats.height_map import HeightMap
from sensors.formats.tables import read_csv
from sensors.typed_yaml import RecipeError

READERS = {".csv": read_csv, ".txt": read_csv, ".npy": read_npy}


def read_height_map(path: str | Path, unit: str | None = None) -> HeightMap:
    """Read an instrument's file.

    Raises
    ------
    RecipeError
        Where it can't be read or isn't what its suffix says.
    """
    path = Path(path)
    if path.suffix.lower() not in READERS:
        raise RecipeError("unknown format", where=path, allowed=", ".join(READERS))
    if not path.is_file():
        raise RecipeError("no such file", where=path)
    return READERS[path.suffix.lower()](path, unit)
