"""Blur of the exposure's travel against closed forms."""

import math

import numpy as np
import pytest

from sensors.effects.motion_blur import MotionBlur
from sensors.law import geometric_law
from sensors.view.view import Reason, View


def test_blur_shifts_a_slope_by_half_the_way(view_of):
    """0.05 mm a profile at 100 Hz is 5 mm/s; 20 ms of exposure are 0.1 mm."""
    y = np.arange(20) * 0.05
    for order, sign in ((y, 1), (y[::-1], -1)):
        view = view_of("plate", solid={"tilt_y_deg": 30.0}, y_mm=order)
        change = MotionBlur(exposure_ms=20.0).signature(view)
        slope = -math.tan(math.radians(30.0))  # the plate rises along y: depth falls
        assert np.allclose(change, sign * slope * 0.05, atol=1e-5)


def test_blur_follows_the_clock(view_of):
    """Encoder steps of 0.05 mm in 10 ms, then in 20 ms: half as fast, half as far."""
    view = view_of("plate", solid={"tilt_y_deg": 30.0}, y_mm=np.arange(20) * 0.05)
    time_s = np.cumsum(np.where(np.arange(20) <= 10, 0.01, 0.02))
    view = View(view.scene, view.sensor, view.poses, time_s)
    change = MotionBlur(exposure_ms=13.0).signature(view)
    slope = -math.tan(math.radians(30.0))
    assert np.allclose(change[:10], slope * 0.0325, atol=1e-5)
    assert np.allclose(change[10:], slope * 0.01625, atol=1e-5)


def test_blur_of_a_curve(view_of):
    """Box of length L from the pose on: bias L²/6 of half the second derivative on the top."""
    y = np.arange(-20, 21) * 0.05
    view = view_of("cylinder", solid={"radius": 30.0}, y_mm=y)
    change = MotionBlur(exposure_ms=40.0).signature(view)[20, 40]
    assert np.isclose(change, 0.2**2 / (6 * 30.0), rtol=0.02)


def test_no_blur_at_rest(view_of):
    view = view_of("step", y_mm=np.full(5, 9.99))
    assert np.all(MotionBlur(exposure_ms=20.0).signature(view) == 0.0)


def test_blur_around_its_middle_leaves_a_slope_in_place(view_of):
    y = np.arange(20) * 0.05
    view = view_of("plate", solid={"tilt_y_deg": 30.0}, y_mm=y)
    change = MotionBlur(exposure_ms=20.0, stamped="middle").signature(view)
    assert np.allclose(change, 0.0, atol=1e-5)


def test_blur_of_a_slope_scatters_as_its_light_flickers(view_of):
    """Mean of N depths, even over s w, with random weights: variance (f s w)²/12, f = C/√N."""
    count, contrast = 40, 0.5
    rng = np.random.default_rng(1)
    weights = rng.gamma(1 / contrast**2, contrast**2, (20_000, count))
    depths = (np.arange(count) + 0.5) / count - 0.5
    drawn = (weights @ depths / weights.sum(axis=1)).std()
    flicker = contrast / math.sqrt(count)
    view = view_of("plate", solid={"tilt_y_deg": 30.0}, y_mm=np.arange(20) * 0.05)
    law = MotionBlur(exposure_ms=20.0, flicker=flicker).apply(geometric_law(view, None), view)
    bare = geometric_law(view, None).white_sd_mm
    added = np.sqrt(np.square(law.white_sd_mm) - bare**2)
    reach = 0.1 * math.tan(math.radians(30.0))
    assert np.allclose(added, flicker * reach / math.sqrt(12))
    assert np.isclose(added.mean(), drawn * reach, rtol=0.03)
    flat = view_of("plate", y_mm=np.arange(20) * 0.05)
    still = MotionBlur(exposure_ms=20.0).apply(geometric_law(flat, None), flat)
    assert np.allclose(still.white_sd_mm, bare)


def test_a_part_of_the_exposure_that_the_camera_sees_is_read(view_of):
    """Beside a step, shadows shrink by what the blur looks past their border; depths stay."""
    y = np.linspace(-19, -13, 121)
    sheet = {"effects": ({"name": "camera_occlusion", "triangulation_angle_deg": 30.0},)}
    view = view_of("step", y_mm=y, sheet=sheet)
    dark = view.sensor.law(view, None)
    blurred = MotionBlur(exposure_ms=80.0, stamped="middle").apply(dark, view)
    before, after = ~np.isfinite(dark.mean_mm), ~np.isfinite(blurred.mean_mm)
    assert np.all(before | ~after)
    # 80 ms at 5 mm/s: the last of eight instants looks 7/16 of 0.4 mm ahead
    gained = (before & ~after).sum(axis=0) * 0.05
    beside = before.any(axis=0)
    assert np.allclose(gained[beside], 0.175, atol=0.051)
    lit = np.isfinite(blurred.mean_mm)
    assert np.all((blurred.reason == Reason.VALID) == lit)
    assert np.allclose(blurred.mean_mm[lit], np.nanmax(dark.mean_mm), atol=1e-6)


@pytest.mark.parametrize("turned", [False, True])
def test_an_exposure_of_nothing_changes_nothing_that_the_file_says_of_edges(view_of, turned):
    """At the edge the file has one level, a line on matt material reads the other: it stays."""
    sheet = {"effects": (
        {"name": "camera_occlusion", "triangulation_angle_deg": 30.0, "line_sd_um": 300.0},
        {"name": "finite_spot", "line_sd_um": 300.0},
        {"name": "edge_mixing", "line_sd_um": 300.0},
    )}  # fmt: skip
    view = view_of("step", y_mm=np.linspace(9.0, 11.5, 126), turned=turned, sheet=sheet)
    law = view.sensor.law(view, None)
    stood = MotionBlur(exposure_ms=1e-3, stamped="middle").apply(law, view)
    assert np.nanmax(law.mean_mm) - np.nanmin(law.mean_mm) > 5.0
    assert np.array_equal(np.isfinite(stood.mean_mm), np.isfinite(law.mean_mm))
    assert np.allclose(stood.mean_mm, law.mean_mm, atol=1e-3, equal_nan=True)


@pytest.mark.parametrize("uneven", [False, True])
def test_a_large_scan_is_blurred_block_by_block(view_of, monkeypatch, uneven):
    """One smear serves all profiles of an even travel, each has its own otherwise."""
    y = np.linspace(-8.0, 8.0, 60)
    view = view_of("step", y_mm=y + 0.02 * np.sin(y) if uneven else y)
    effect = MotionBlur(exposure_ms=80.0)
    whole = effect.apply(geometric_law(view, None), view)
    monkeypatch.setattr("sensors.line.line_operator.BLOCK_POINTS", 7 * view.shape[1])
    parts = effect.apply(geometric_law(view, None), view)
    assert np.array_equal(whole.mean_mm, parts.mean_mm, equal_nan=True)
    assert np.array_equal(whole.white_sd_mm, parts.white_sd_mm)
