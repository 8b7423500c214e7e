"""Datasets of an HDF5 file that a stranger made: within budget, and in that file alone."""

from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from files.budget import allow
from files.errors import RecipeError


def has(file: h5py.File, key: str) -> bool:
    """Whether a file has an entry of its own; a link elsewhere is not followed."""
    return file.get(key, getlink=True) is not None


def lies_elsewhere(file: h5py.File, key: str) -> bool:
    """Whether an entry leads out of its file: HDF5 opens whatever a link or dataset names."""
    if not isinstance(file.get(key, getlink=True), h5py.HardLink):
        return True
    entry = file[key]
    return isinstance(entry, h5py.Dataset) and (bool(entry.external) or entry.is_virtual)


def numbers(file: h5py.File, key: str, path: str | Path) -> NDArray[np.float64]:
    """Read a dataset of numbers.

    Raises
    ------
    RecipeError
        Where it is absent, leads to another file, holds no numbers, or too many.
    """
    if not has(file, key):
        raise RecipeError(f"has no /{key}", where=path)
    if lies_elsewhere(file, key):
        raise RecipeError(f"/{key} lies in another file", where=path, allowed="numbers in this one")
    dataset = file[key]
    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiu":
        raise RecipeError(f"/{key} should hold numbers", where=path)
    allow("readings", dataset.size or 0, where=path)
    if dataset.shape is None:
        raise RecipeError(f"/{key} is empty", where=path)
    return np.asarray(dataset[...], dtype=np.float64)
