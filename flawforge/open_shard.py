"""A shard open for reading: each array and its coding is looked up at its first access.

It is a file, or an object of an object store.
"""

import importlib
import json
import os
from pathlib import Path
from typing import Any, Final, Self

import h5py
import numpy as np
from numpy.typing import NDArray

FORMAT: Final = "flawforge-shard"
VERSION: Final = 1
PLUGIN: Final = "hdf5plugin"  # brings HDF5's filters for shards compressed by zstd or lz4
STORES: Final = "upath"  # universal-pathlib: objects of a store with the methods of `pathlib`
BLOCK: Final = 1 << 22  # bytes of an object that are read at a time
CODING: Final = ("scale_mm", "offset_mm", "missing")


class ShardError(ValueError):
    """Stored data that is damaged or missing: which file, and what is wrong with it."""

    def __init__(self, path: str | Path, what: str) -> None:
        super().__init__(f"{path}: {what}")


class OpenShard:
    """The arrays of a shard; an access reads one scan of one array.

    Attributes
    ----------
    path : Path
    file : h5py.File
    names : list of str
        The scans' names, by row.
    fields : list of str
        The arrays' names.
    """

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self.file = file
        self.fields = sorted(file)
        self._arrays: dict[str, h5py.Dataset] = {}
        self._codings: dict[str, dict[str, float]] = {}
        self.names = [text(name) for name in self._read("scan_id", ...)]

    @classmethod
    def at(cls, path: Path) -> Self:
        """Open a shard.

        Raises
        ------
        ShardError
            Where it is missing, damaged, of another format, or a package for it is.
        """
        try:
            file = h5py.File(source(path), "r")
        except FileNotFoundError:
            raise ShardError(path, "is missing") from None
        except OSError as error:
            raise ShardError(path, f"is damaged or no HDF5 file ({error})") from None
        try:
            kind, version = file.attrs.get("format"), file.attrs.get("version", VERSION)
            if text(kind) != FORMAT or int(version) > VERSION:
                raise ShardError(path, f"is no {FORMAT} up to version {VERSION}")
            if "reader_needs" in file.attrs:
                importlib.import_module(PLUGIN)
            return cls(path, file)
        except ImportError:
            file.close()
            raise ShardError(path, f"needs {PLUGIN}: pip install {PLUGIN}") from None
        except ShardError:
            file.close()
            raise

    @property
    def classes(self) -> dict[str, str]:
        """Names of the mask's values."""
        found: dict[str, str] = json.loads(self.file.attrs["classes"])
        return found

    def coding(self, field: str) -> dict[str, float]:
        """Return `scale_mm`, `offset_mm` and `missing` of counts; empty for plain numbers."""
        if field not in self._codings:
            attributes = self._array(field).attrs
            self._codings[field] = {k: attributes[k].item() for k in CODING if k in attributes}
        return self._codings[field]

    def scan(self, field: str, row: int) -> NDArray[Any]:
        """Return one scan's array as it is stored.

        Raises
        ------
        ShardError
            Where there is none, or it can't be read.
        """
        return self._read(field, row)

    def depth_mm(self, field: str, counts: NDArray[Any]) -> NDArray[np.float64]:
        """Return depths, NaN = missing, of an array's counts."""
        coding = self.coding(field)
        found: NDArray[np.float64] = counts * coding["scale_mm"]
        found += coding["offset_mm"]
        found[counts == coding["missing"]] = np.nan
        return found

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def _array(self, field: str) -> h5py.Dataset:
        if field not in self._arrays:
            if field not in self.fields:
                there = ", ".join(self.fields)
                raise ShardError(self.path, f"holds no '{field}'; it holds {there}")
            self._arrays[field] = self._own(field)
        return self._arrays[field]

    def _own(self, field: str) -> h5py.Dataset:
        """Look up an array of this file: HDF5 opens whatever a link or an array names."""
        if isinstance(self.file.get(field, getlink=True), h5py.HardLink):
            array = self.file[field]
            if not array.external and not array.is_virtual:
                return array
        raise ShardError(self.path, f"'{field}' lies in another file")

    def _read(self, field: str, row: Any) -> NDArray[Any]:
        array = self._array(field)
        try:
            return np.asarray(array[row])
        except (OSError, ValueError, RuntimeError) as error:
            where = "" if row is ... else f" of row {row}"
            raise ShardError(self.path, f"'{field}'{where} can't be read ({error})") from None


def place(folder: str | Path) -> Path:
    """Return the path of a folder, or of a prefix of an object store such as s3://bucket/prefix.

    Raises
    ------
    ShardError
        Where a package for the store is missing, or the store can't be reached.
    """
    if "://" not in str(folder):
        return Path(folder)
    try:
        found: Any = importlib.import_module(STORES).UPath(folder, use_listings_cache=False)
        found.exists()
    except ImportError as error:
        raise ShardError(folder, f"needs pip install 'flawforge[s3]' ({error})") from None
    except Exception as error:  # each store's package has errors of its own
        raise ShardError(folder, f"the object store can't be used ({error})") from None
    return Path(found) if isinstance(found, os.PathLike) else found


def source(path: Path) -> Any:
    """Return what h5py and pandas read: a file's path, or an object that is open."""
    if isinstance(path, os.PathLike):
        return path
    opened: Any = path.open
    return opened("rb", block_size=BLOCK)


def text(value: Any) -> str:
    """Return what HDF5 gives for a string, as one."""
    return value.decode() if isinstance(value, bytes) else str(value)
