"""A dataset's tables as they are read: whole, and with names that name nothing but themselves."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from files.budget import regular
from files.errors import RecipeError
from files.place import source

if TYPE_CHECKING:
    import pandas as pd

NAMES: Final = ("scan_id", "part", "specimen", "split", "shard", "kind")
"""Columns of which exports and readers make names of files and folders."""
_LEADS_OUT: Final = re.compile(r"\.{0,2}|.*[/\\\0-\x1f].*", re.DOTALL)


def is_plain(name: str) -> bool:
    """Whether a name is one of a file or folder, and of no path."""
    return _LEADS_OUT.fullmatch(name) is None


def read_table(path: Path) -> "pd.DataFrame":
    """Read a table from Parquet or CSV.

    Raises
    ------
    RecipeError
        Where it is damaged, its texts included, or a name in it leads out of the dataset.
    """
    import pandas as pd

    regular(path)
    at = source(path)
    try:
        table = pd.read_csv(at) if path.suffix == ".csv" else pd.read_parquet(at)
        texts = {  # decoded here, not where they are used first
            str(name): table[name].tolist() for name in table if table[name].dtype.kind == "O"
        }
    except Exception as error:  # whatever a damaged table makes of its reader
        said = " ".join(str(error).split())[:120]
        raise RecipeError(f"can't be read ({said})", where=path) from None
    for column in NAMES:
        for name in texts.get(column, ()):
            if isinstance(name, str) and not is_plain(name):
                raise RecipeError(f"'{column}' isn't a plain name", where=path, value=name)
    return table
