"""Chunks of HDF5 datasets, shuffled and deflated by ISA-L, readable by any HDF5 library.

ISA-L deflates five to six times faster than the zlib that HDF5 calls, see `benchmarks/waits.py`.
Of its levels, 2 is the densest of the fast ones; 3 took three times as long on a scan of the car
door and was no denser.
"""

from typing import Any

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

LEVEL = 2


def deflated(values: NDArray[Any], rows: int) -> bytes:
    """Return a chunk's bytes, equal to those of HDF5's filters shuffle and deflate.

    Parameters
    ----------
    values
        (r, ...) the chunk's values, r <= rows.
    rows
        Rows of a full chunk; those that `values` lacks are 0.
    """
    size = values.dtype.itemsize
    plain = np.zeros((rows, *values.shape[1:]), values.dtype) if len(values) < rows else values
    if plain is not values:
        plain[: len(values)] = values
    octets = np.ascontiguousarray(plain).reshape(-1).view(np.uint8)
    return isal_zlib.compress(_shuffled(octets, size).data, LEVEL)


def _shuffled(octets: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
    """Return all values' first bytes, then their second ones, and so on, (size, n)."""
    planes = np.empty((size, octets.size // size), dtype=np.uint8)
    if size not in (2, 4, 8):
        planes[...] = octets.reshape(-1, size).T
        return planes
    words = octets.view(f"<u{size}")  # shifts are two to four times faster than steps in memory
    for number, plane in enumerate(planes):
        plane[...] = words >> words.dtype.type(8 * number)  # the lowest byte is kept
    return planes
