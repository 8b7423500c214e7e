"""Where a dataset lies: a folder, or a prefix of an object store by its URL, s3://bucket/prefix.

Only this module uses universal-pathlib, which gives objects the methods of `pathlib`; fsspec finds
the package of the store (s3fs). A folder needs neither.
"""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedIOBase
from pathlib import Path
from typing import Any, Final, cast

from files.errors import RecipeError

BLOCK: Final = 1 << 22  # bytes of an object that are read at a time


def is_url(given: str | Path) -> bool:
    """Return whether a place is given by a URL."""
    return "://" in str(given)


def place(given: str | Path) -> Path:
    """Return the path of a folder, or of a prefix of an object store, with the same methods.

    Raises
    ------
    RecipeError
        Where the package for the store isn't installed, or the store can't be reached.
    """
    if not is_url(given):
        return Path(given)
    with reached(given):
        from upath import UPath

        found: Any = UPath(str(given).rstrip("/"), use_listings_cache=False)
        if isinstance(found, os.PathLike):  # file://
            return Path(found)
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # the error says what was lost
        found.exists()
    return cast(Path, found)


def is_local(path: Path) -> bool:
    """Return whether a path is one of this machine's file system."""
    return isinstance(path, Path)


@contextmanager
def reached(where: str | Path, *, but: type[Exception] | tuple[()] = ()) -> Iterator[None]:
    """Turn the errors of an object store's packages into one line; a folder's errors stay.

    Parameters
    ----------
    where
        The place that is used.
    but
        An error that stays as it is.

    Raises
    ------
    RecipeError
        Naming the place and the reason.
    """
    if not is_url(where):
        yield
        return
    try:
        yield
    except but:
        raise
    except ImportError as error:
        raise RecipeError(
            f"a package for this store isn't installed ({error})", where=where,
            allowed="for s3:// it comes with: pip install 'flawforge[s3]'",
        ) from None  # fmt: skip
    except Exception as error:  # each store's package has errors of its own
        why = str(error).strip().splitlines() or [type(error).__name__]
        raise RecipeError(
            f"the object store can't be used ({why[0]})", where=where,
            allowed="a bucket that exists, with the keys and endpoint of your environment",
        ) from None  # fmt: skip


def reading(path: Path) -> BufferedIOBase:
    """Open a file or an object for reading."""
    if is_local(path):
        return path.open("rb")
    found: BufferedIOBase = cast(Any, path).open("rb", block_size=BLOCK)
    return found


def source(path: Path) -> Any:
    """Return what h5py and pandas read: a file's path, or an object that is open."""
    return path if is_local(path) else reading(path)


def names(prefix: Path) -> list[str]:
    """Return the names of all objects under a prefix."""
    at = cast(Any, prefix)
    with reached(prefix):
        return [name.removeprefix(f"{at.path}/") for name in at.fs.find(at.path)]


def put(file: Path, at: Path, *, new: bool = False) -> None:
    """Upload a file; readers see the object before or the whole new one.

    Parameters
    ----------
    file, at
        The file, and the path of the object.
    new
        Refuse to replace an object, where the store can (S3: a conditional write).

    Raises
    ------
    FileExistsError
        Where there is a `new` object already.
    RecipeError
        Where the store can't be used.
    """
    to = cast(Any, at)
    with reached(at, but=FileExistsError if new else ()):
        to.fs.put_file(str(file), to.path, mode="create" if new else "overwrite")
