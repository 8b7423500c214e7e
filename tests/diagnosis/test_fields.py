"""Arrays over readings: a scale that outliers leave alone, masks that reach farther."""

import numpy as np
from scipy.ndimage import binary_dilation

from diagnosis.fields import median_sd, widened


def test_the_median_gives_the_deviation_of_normal_values():
    away = np.random.default_rng(0).normal(0, 0.3, (200, 500))
    assert np.isclose(median_sd(away), 0.3, rtol=0.01)
    away[:60] = 50.0
    assert median_sd(away) < 0.3 * 1.6


def test_a_mask_is_widened_by_a_rectangle():
    mask = np.random.default_rng(0).random((40, 30)) < 0.01
    for reach in ((0, 0), (1, 1), (5, 2), (3, 0)):
        window = np.ones([2 * one + 1 for one in reach], dtype=bool)
        assert np.array_equal(widened(mask, reach), binary_dilation(mask, window))
