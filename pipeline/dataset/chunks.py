"""Chunks of HDF5 datasets, shuffled and deflated by libdeflate, readable by any HDF5 library.

libdeflate is twice as fast as the zlib that HDF5 calls (`benchmarks/waits.py`), and its bytes
depend on its version and the data alone. Those of ISA-L, faster still, depend on the address of its
stack: a pointer enters the hash of the third position (`.write_first_byte` in 2.32's
`igzip_icf_body_h1_gr_bt.asm`), so one small chunk in some thousands differs from run to run.
Of libdeflate's levels, 2 is the fastest on scans; denser ones save less than 1 %.
"""

from typing import Any

import deflate
import numpy as np
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
    return bytes(deflate.zlib_compress(_shuffled(octets, size).data, LEVEL))


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
