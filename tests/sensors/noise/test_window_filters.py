"""Firmware's filters against closed forms, and the law of a median against draws."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sensors.noise.window_filters import (
    gaps_filled,
    median_law,
    windowed_mean,
    windowed_median,
)

READINGS = arrays(
    np.float64,
    st.tuples(st.integers(1, 6), st.integers(1, 12)),
    elements=st.one_of(st.just(math.nan), st.integers(-50, 50).map(float)),
)


@settings(deadline=None)  # compiled at the first call
@given(READINGS, st.sampled_from([1, 3, 5]), st.sampled_from([1, 3, 5]))
def test_windows_hold_the_readings_about_each(depth, profiles, points):
    """Against NumPy's own median and mean of each window; missing stay missing."""
    median, mean = (f(depth, profiles, points) for f in (windowed_median, windowed_mean))
    for i, j in np.ndindex(depth.shape):
        if np.isnan(depth[i, j]):
            assert np.isnan(median[i, j])
            assert np.isnan(mean[i, j])
            continue
        window = depth[
            max(0, i - profiles // 2) : i + profiles // 2 + 1,
            max(0, j - points // 2) : j + points // 2 + 1,
        ]
        assert median[i, j] == np.nanmedian(window)
        assert np.isclose(mean[i, j], np.nanmean(window))


@settings(deadline=None)  # compiled at the first call
@given(READINGS, st.integers(0, 4))
def test_gaps_are_filled_by_straight_lines_up_to_their_length(depth, most):
    filled = gaps_filled(depth, most)
    for before, after in zip(depth, filled, strict=True):
        known = np.flatnonzero(np.isfinite(before))
        assert np.array_equal(after[known], before[known])
        for left, right in zip(known[:-1], known[1:], strict=True):
            gap = after[left + 1 : right]
            if right - left - 1 > most:
                assert np.isnan(gap).all()
            else:
                assert np.allclose(
                    after[left : right + 1], np.linspace(*after[[left, right]], right - left + 1)
                )
        if known.size:
            assert np.isnan(after[: known[0]]).all()
            assert np.isnan(after[known[-1] + 1 :]).all()


@pytest.mark.parametrize(("points", "variance"), [(3, 0.4487), (5, 0.2868), (7, 0.2104)])
def test_variance_of_the_median_of_a_flat(points, variance):
    """Exact variances of the median of normal samples (Teichroew, Ann. Math. Statist. 27, 1956)."""
    flat = np.zeros((3, 15))
    middle, found, down, across = median_law(flat, np.ones(flat.shape), np.array([1, points]))
    assert middle[1, 7] == 0.0
    assert np.isclose(found[1, 7], variance, rtol=0.03)
    assert np.isclose(across[1, 7], points)
    assert down[1, 7] == 1.0


@pytest.mark.parametrize("window", [(1, 3), (1, 5), (3, 3)])
@pytest.mark.parametrize("slope", [0.0, 0.5, 1.0, 2.0, 6.0])
def test_law_of_the_median_on_a_slope(window, slope):
    means = np.tile(slope * np.arange(7.0), (5, 1))
    rng = np.random.default_rng(5)
    draws = np.stack(
        [windowed_median(means + rng.standard_normal(means.shape), *window) for _ in range(6000)]
    )[:, 2, 3]
    middle, variance, _, across = median_law(means, np.ones(means.shape), np.array(window))
    assert np.isclose(draws.mean(), middle[2, 3], atol=0.06)
    assert np.isclose(draws.var(), variance[2, 3], rtol=0.1)
    if slope == 6.0:
        assert np.isclose(across[2, 3], 1.0, atol=1e-6)  # its own level alone


def test_median_beside_a_step_leans_to_its_level():
    """Four of nine readings lie far below: the median is the least of the five others."""
    means = np.zeros((3, 3))
    means.flat[:4] = -100.0
    middle, variance, _, _ = median_law(means, np.ones((3, 3)), np.array([3, 3]))
    rng = np.random.default_rng(2)
    draws = np.median((means + rng.standard_normal((20000, 3, 3))).reshape(-1, 9), axis=1)
    assert np.isclose(middle[1, 1], draws.mean(), atol=0.12)  # -1.16
    assert np.isclose(variance[1, 1], draws.var(), rtol=0.35)
