"""Brightness: speckle goes, prints stay where they are."""

import numpy as np

from diagnosis.data.brightness import (
    by_direction,
    smoothed_brightness,
    surface_brightness,
)
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.small_parts import datasheet, part, poses


def speckled(base: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return base * np.exp(0.3 * rng.standard_normal(base.shape))


def test_speckle_alone_leaves_next_to_nothing() -> None:
    raw = speckled(np.full((120, 160), 0.5), 1)
    left = np.log(smoothed_brightness(raw))
    # the median of 15 along rows and columns: 1.25 / 15 of the scatter at best
    assert left.std() < 0.15 * np.log(raw).std()


def test_an_albedo_pattern_keeps_its_edge_and_its_contrast() -> None:
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


def test_a_ridge_between_a_bright_and_a_dark_flank_stays_sharp() -> None:
    view = View(
        part("wedge"), SensorModel(datasheet(100)), poses(60, pitch_mm=0.3), np.arange(60) / 200.0
    )
    base = np.where(view.slope_x > 0, 0.6, 0.3)
    base = np.where(np.isfinite(view.depth_mm), base, np.nan)
    left = surface_brightness(speckled(base, 4), view)
    off = np.abs(np.nanmedian(np.log(left / base), axis=0))
    ridge = int(np.flatnonzero(np.diff(np.nanmedian(base, axis=0)))[0])
    assert off[ridge - 2 : ridge + 4].max() < 0.12
    np.testing.assert_array_equal(np.isnan(left), np.isnan(base))


def test_directions_that_few_readings_have_take_their_neighbours_brightness() -> None:
    view = View(
        part("domes"), SensorModel(datasheet(100)), poses(60, pitch_mm=0.3), np.arange(60) / 200.0
    )
    usual = by_direction(np.full(view.shape, 0.4), view)
    assert np.allclose(usual[np.isfinite(view.depth_mm)], 0.4)


def test_an_albedo_pattern_on_a_curved_part_makes_no_creases() -> None:
    view = View(
        part("domes"), SensorModel(datasheet(100)), poses(120, pitch_mm=0.3), np.arange(120) / 200.0
    )
    base = np.where((np.arange(120) // 30) % 2, 0.6, 0.2)[:, None] * np.ones((1, 100))
    raw = speckled(base, 5)
    np.testing.assert_array_equal(surface_brightness(raw, view), smoothed_brightness(raw))


def test_strokes_narrower_than_a_median_keep_their_contrast() -> None:
    """Letters of two profiles, as on a key, under speckle of an eighth."""
    base = np.full((90, 90), 0.3)
    for row in range(10, 80, 9):
        base[row : row + 2, 10:80] = 1.0
    raw = base * np.exp(0.12 * np.random.default_rng(6).standard_normal(base.shape))
    left = smoothed_brightness(raw)
    assert np.median(left[10:80:9, 15:75]) > 0.8
    assert np.median(left[14:80:9, 15:75]) < 0.4
