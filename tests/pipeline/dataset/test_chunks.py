"""Chunks written directly are what HDF5's own filters read, byte for byte the same anywhere."""

import subprocess
import sys

import h5py
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.dataset.chunks import deflated
from tests.support.processes import HOME

SUM_OF_MANY = """
import hashlib
import numpy as np
from pipeline.dataset.chunks import deflated
rng, digest = np.random.default_rng(0), hashlib.sha256()
for _ in range(2000):
    start, rest = rng.integers(0, 9, 8, np.uint8), rng.integers(0, 9, 200, np.uint8)
    digest.update(deflated(np.concatenate([start, rest, start, rest[::-1]])[:, None], 416))
print(digest.hexdigest())
"""


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    kind=st.sampled_from(["u1", "u2", "u4", "f4", "f8"]),
    rows=st.integers(1, 9),
    length=st.integers(1, 30),
    inner=st.sampled_from([(), (7,), (4, 4)]),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_hdf5_reads_what_was_written(tmp_path, kind, rows, length, inner, seed):
    rng = np.random.default_rng(seed)
    rows = min(rows, length)
    values = rng.integers(0, 200, (length, *inner)).astype(kind)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        made = file.create_dataset(
            "x", (1, length, *inner), kind, chunks=(1, rows, *inner), compression="gzip",
            compression_opts=1, shuffle=True,
        )  # fmt: skip
        for first in range(0, length, rows):
            part = values[first : first + rows]
            made.id.write_direct_chunk((0, first, *([0] * len(inner))), deflated(part, rows))
    with h5py.File(tmp_path / "a.h5") as file:
        np.testing.assert_array_equal(file["x"][0], values)


def test_a_chunk_of_one_row_less_is_filled_with_zeros():
    values = np.arange(12, dtype=np.uint16).reshape(3, 4)
    padded = np.vstack([values, np.zeros((1, 4), np.uint16)])
    assert deflated(values, 4) == deflated(padded, 4)
    assert len(deflated(np.zeros((64, 4096), np.uint8), 64)) < 5000


def test_bytes_depend_on_no_process():
    """Chunks that begin as they go on: where a pointer enters a hash, a few of them differ."""
    runs = [
        subprocess.check_output([sys.executable, "-c", SUM_OF_MANY], cwd=HOME) for _ in range(3)
    ]
    assert len(set(runs)) == 1
