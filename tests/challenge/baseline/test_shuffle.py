"""The shuffled baseline keeps what it moves."""

import numpy as np

from challenge.baseline.shuffle import moved_blocks


def test_shuffling_keeps_the_values_and_moves_them():
    values = np.arange(40.0 * 50).reshape(40, 50)
    moved = moved_blocks(values, np.array([5, 4, 3, 2, 1, 0]))
    np.testing.assert_array_equal(np.sort(moved.ravel()), values.ravel())
    np.testing.assert_array_equal(moved[:16, :16], values[16:32, 32:48])
    np.testing.assert_array_equal(moved[32:], values[32:])
