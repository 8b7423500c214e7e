import numpy as np

from diagnosis.fields import median_sd


def test_the_median_gives_the_deviation_of_normal_values():
    away = np.random.default_rng(0).normal(0, 0.3, (200, 500))
    assert np.isclose(median_sd(away), 0.3, rtol=0.01)
    away[:60] = 50.0
    assert median_sd(away) < 0.3 * 1.6
