"""The shuffled baseline keeps what it moves."""

import shutil

import h5py
import numpy as np

from challenge.baseline.shuffle import moved_blocks, shuffle


def test_shuffling_keeps_the_values_and_moves_them():
    values = np.arange(40.0 * 50).reshape(40, 50)
    moved = moved_blocks(values, np.array([5, 4, 3, 2, 1, 0]))
    np.testing.assert_array_equal(np.sort(moved.ravel()), values.ravel())
    np.testing.assert_array_equal(moved[:16, :16], values[16:32, 32:48])
    np.testing.assert_array_equal(moved[32:], values[32:])


def test_shuffled_case_keeps_its_geometry(bowed, tmp_path):
    _, _, folder = bowed
    here = tmp_path / "case"
    shutil.copytree(folder, here)
    shuffle(here, np.random.default_rng(0))
    for name in ("a", "b"):
        with h5py.File(folder / f"{name}.h5") as file, h5py.File(here / f"{name}.h5") as other:
            was, now = file["depth"][:], other["depth"][:]
            np.testing.assert_array_equal(file["pose"][:], other["pose"][:])
            assert was.shape == now.shape
            change = (now - was)[np.isfinite(now) & np.isfinite(was)]
            assert 0.001 < np.median(np.abs(change)) < 0.2  # residuals moved, the part did not
