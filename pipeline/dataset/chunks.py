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
    shuffled = np.ascontiguousarray(octets.reshape(-1, size).T)
    return isal_zlib.compress(shuffled.data, LEVEL)
