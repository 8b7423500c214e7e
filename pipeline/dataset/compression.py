"""Compression of shards, and the packages that a reader needs.

The default is deflate, which any HDF5 library reads. zstd and lz4 are HDF5's registered filters
32015 and 32004, which the package hdf5plugin brings.
"""

import importlib
from pathlib import Path
from typing import Any, Final, Literal

Compression = Literal["deflate", "zstd", "lz4", "none"]

PLUGIN: Final = "hdf5plugin"
PLUGGED: Final[dict[str, str]] = {"zstd": "Zstd", "lz4": "LZ4"}  # classes of hdf5plugin
NEEDS: Final = "reader_needs"  # attribute of a shard: what to import before its arrays are read


def reader_needs(compression: Compression) -> str | None:
    """Return the package that a reader has to import in addition to h5py."""
    return PLUGIN if compression in PLUGGED else None


def filters(compression: Compression) -> dict[str, Any]:
    """Return the arguments of `h5py.Group.create_dataset` for a compression.

    Raises
    ------
    ImportError
        Where the package that brings the filter isn't installed.
    """
    if compression == "none":
        return {}
    if compression == "deflate":
        # what HDF5 itself would use; chunks are written by `pipeline.dataset.chunks`
        return {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    plugin = importlib.import_module(PLUGIN)
    return {**getattr(plugin, PLUGGED[compression])(), "shuffle": True}


def opened(path: Path) -> Any:
    """Open a shard for reading, as an `h5py.File`, with the filters that it needs.

    Raises
    ------
    OSError
        Where it can't be read, an array of it lies in another file, or the package with its filter
        isn't installed.
    """
    import h5py

    from files.budget import regular
    from files.hdf5_input import lies_elsewhere
    from files.place import source

    regular(path)
    file = h5py.File(source(path), "r")
    foreign = [key for key in file if lies_elsewhere(file, key)]
    if foreign:
        file.close()
        raise OSError(f"its '{foreign[0]}' lies in another file")
    if NEEDS in file.attrs:
        try:
            importlib.import_module(PLUGIN)
        except ImportError:
            file.close()
            raise OSError(f"needs {PLUGIN}: pip install {PLUGIN}") from None
    return file
