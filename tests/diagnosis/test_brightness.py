"""Brightness: speckle goes, prints stay where they are."""

import numpy as np

from diagnosis.brightness import smoothed_brightness


def speckled(base: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return base * np.exp(0.3 * rng.standard_normal(base.shape))


def test_speckle_alone_leaves_next_to_nothing() -> None:
    raw = speckled(np.full((120, 160), 0.5), 1)
    left = np.log(smoothed_brightness(raw))
    # the median of 15 along rows and columns: 1.25 / 15 of the scatter at best
    assert left.std() < 0.15 * np.log(raw).std()


def test_a_print_keeps_its_edge_and_its_contrast() -> None:
    base = np.full((120, 160), 0.6)
    base[40:80, 50:110] = 0.15
    left = smoothed_brightness(speckled(base, 2))
    assert abs(np.log(left[50:70, 70:90]).mean() - np.log(0.15)) < 0.05
    assert abs(np.log(left[:20]).mean() - np.log(0.6)) < 0.05
    middle = np.sqrt(0.6 * 0.15)
    crossing = (left[:, 60:100] < middle).argmax(axis=0)
    assert np.abs(crossing - 40).max() <= 2
    assert np.abs(crossing - 40).mean() < 1


def test_missing_readings_stay_missing() -> None:
    raw = speckled(np.full((60, 60), 0.5), 3)
    raw[10:20, 10:20] = np.nan
    left = smoothed_brightness(raw)
    np.testing.assert_array_equal(np.isnan(left), np.isnan(raw))
