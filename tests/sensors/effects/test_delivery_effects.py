"""Effects of the firmware: what is delivered is what was measured, filtered or repeated."""

import dataclasses
import math

import numpy as np
import pytest

from sensors.effects.line_bow import LineBow
from sensors.effects.onboard_filter import OnboardFilter
from sensors.effects.outlier_spikes import OutlierSpikes
from sensors.effects.random_dropout import RandomDropout
from sensors.effects.row_repeat import RowRepeat, brightness_delivered
from sensors.law import geometric_law
from sensors.model import SensorModel, scan_with
from sensors.noise.perlin import PerlinField
from sensors.recording import repeated_rows
from sensors.view.view import Reason

NO_FILTER = {"median_points": 1, "median_profiles": 1, "mean_points": 1, "mean_profiles": 1}
FIELD = PerlinField(amplitude_mm=0.03, cell_x_mm=2.0, cell_y_mm=2.0)


def streams(seed):
    return lambda name: np.random.default_rng([seed, *map(ord, name)])


def only(**filters):
    return OnboardFilter(**{**NO_FILTER, **filters})


@pytest.fixture
def flat(view_of):
    return view_of("plate", sheet={"points_per_profile": 200, "z_resolution_um": 0.1})


@pytest.mark.parametrize("width", [3, 5, 9])
def test_mean_of_white_noise_has_its_root_and_its_triangle(flat, width):
    """σ/√w, and a correlation 1 - lag/w, zero from w on."""
    bare = geometric_law(flat, None)
    law = only(mean_points=width).apply(bare, flat)
    inside = np.s_[:, width:-width]
    assert np.allclose(law.sd_mm(flat)[inside], bare.sd_mm(flat)[0, 0] / math.sqrt(width), 1e-3)
    residual = law.sample(streams(1), flat)[0][inside] - flat.depth_mm[inside]
    assert np.isclose(residual.std(), law.sd_mm(flat)[30, 100], rtol=0.03)
    for lag in (1, 2, width):
        one, two = residual[:, :-lag].ravel(), residual[:, lag:].ravel()
        assert np.isclose(np.corrcoef(one, two)[0, 1], max(0.0, 1 - lag / width), atol=0.06)


@pytest.mark.parametrize(
    "filters",
    [
        {"median_points": 3, "median_profiles": 3},
        {"median_points": 5, "mean_points": 5},
        {"median_points": 3, "median_profiles": 3, "mean_points": 5},
        {"mean_points": 4, "mean_profiles": 3},
    ],
)
@pytest.mark.parametrize("field", [None, FIELD], ids=["white", "speckle"])
def test_filters_after_one_another_leave_the_claimed_noise(flat, filters, field):
    law = only(**filters).apply(geometric_law(flat, field), flat)
    draws = np.stack([law.sample(streams(seed), flat)[0] for seed in range(12)])
    realised = np.var(draws[:, 4:-4, 8:-8] - flat.depth_mm[4:-4, 8:-8])
    claimed = np.mean(np.square(law.sd_mm(flat)[4:-4, 8:-8]))
    assert np.isclose(realised, claimed, rtol=0.12)


def test_mean_over_a_step_is_a_ramp_and_a_median_keeps_it(view_of):
    view = view_of("step", sheet={"points_per_profile": 121, "repeatability_um": 0.0})
    bare = geometric_law(view, None)
    row = np.abs(view.poses[:, 1, 3]).argmin()
    edge = np.flatnonzero(np.abs(np.diff(bare.mean_mm[row])) > 5)[0]
    near = np.s_[row, edge - 3 : edge + 5]
    kept = only(median_points=3).apply(bare, view).mean_mm[near]
    assert np.allclose(kept, bare.mean_mm[near], atol=2e-3)
    ramp = only(mean_points=5).apply(bare, view).mean_mm[near]
    steps = np.diff(ramp) / (bare.mean_mm[near][-1] - bare.mean_mm[near][0])
    assert np.allclose(steps[1:6], 0.2, atol=1e-6)


def test_gaps_up_to_the_length_come_back(flat):
    """Readings lost one by one with p leave p (1 - (1-p)²) once single gaps are filled."""
    lossy = RandomDropout(share=0.2).apply(geometric_law(flat, None), flat)
    for most, left in ((1, 0.2 * (1 - 0.64)), (2, 0.2 * (1 - 0.64 * 1.4))):
        law = only(gap_points=most).apply(lossy, flat)
        depth, reason = law.sample(streams(3), flat)
        assert np.isclose(np.mean(law.p_missing), left)
        assert np.isclose(np.isnan(depth).mean(), left, atol=0.01)
        assert np.array_equal(np.isnan(depth), reason > 0)
    large = RandomDropout(share=0.2, patch_mm=8.0).apply(geometric_law(flat, None), flat)
    assert np.allclose(only(gap_points=2).apply(large, flat).p_missing, 0.2)


def test_median_takes_spikes_away(flat):
    spiky = OutlierSpikes(share=0.01, width_um=2000.0).apply(geometric_law(flat, None), flat)
    law = only(median_points=3, median_profiles=3).apply(spiky, flat)
    assert np.max(law.p_outlier) < 2e-7
    assert np.abs(law.sample(streams(4), flat)[0] - flat.depth_mm).max() < 0.03


def test_readings_stay_multiples_of_the_step(view_of):
    view = view_of("bench", sheet={"z_resolution_um": 10.0})
    depth, _ = OnboardFilter().apply(geometric_law(view, FIELD), view).sample(streams(0), view)
    counts = depth[np.isfinite(depth)] / 0.01
    assert np.allclose(counts, np.rint(counts), atol=1e-6)


def test_firmware_comes_last_wherever_it_is_listed(view_of):
    view = view_of("bench")
    first = (OnboardFilter(), LineBow(sag_um=400.0))
    one, other = (
        scan_with(view, FIELD, effects)[1].sample(streams(1), view)[0]
        for effects in (first, first[::-1])
    )
    assert one.tobytes() == other.tobytes()
    listed = dataclasses.replace(
        view.datasheet, effects=tuple(effect.to_mapping() for effect in first)
    )
    again = type(view)(view.scene, SensorModel(listed), view.poses, view.time_s, laser=view.laser)
    assert again.sensor.law(again, FIELD).sample(streams(1), again)[0].tobytes() == one.tobytes()


@pytest.mark.parametrize("share", [0.05, 0.4])
def test_profiles_repeat_with_their_share(view_of, share):
    view = view_of("bench", y_mm=np.linspace(-24.7, 24.6, 1000))
    bare = geometric_law(view, FIELD)
    depth, _ = RowRepeat(share=share).apply(bare, view).sample(streams(6), view)
    measured, _ = bare.sample(streams(6), view)
    again = repeated_rows(depth)
    assert np.isclose(again.mean(), share, atol=4 * math.sqrt(share * (1 - share) / 1000))
    kept = ~again
    assert np.array_equal(depth[kept], measured[kept], equal_nan=True)


def test_repeated_profiles_lag_behind_on_a_slope(view_of):
    """Mean lag of a geometric number of profiles: share / (1 - share) steps."""
    view = view_of("plate", solid={"tilt_y_deg": 30.0})
    law = RowRepeat(share=0.2).apply(geometric_law(view, None), view)
    step = np.diff(view.depth_mm[:, 40])[0]
    lag = (view.depth_mm - law.mean_mm)[40, 40] / step
    assert np.isclose(lag, 0.25, rtol=1e-3)
    scatter = law.sd_mm(view)[40, 40] ** 2 - geometric_law(view, None).sd_mm(view)[40, 40] ** 2
    assert np.isclose(scatter, 0.2 / 0.8**2 * step**2, rtol=1e-3)


def test_a_repeated_profile_reaches_beyond_the_part(view_of):
    view = view_of("end", y_mm=np.linspace(-15.0, 15.0, 60))
    law = RowRepeat(share=0.3).apply(geometric_law(view, None), view)
    beyond = np.flatnonzero(view.in_range[:, 40])[-1] + 1
    p_missing = np.broadcast_to(law.p_missing, view.shape)
    assert np.isclose(p_missing[beyond, 40], 0.7)
    assert np.isclose(p_missing[beyond + 1, 40], 1 - 0.3**2)
    _, reason = law.sample(streams(2), view)
    assert set(np.unique(reason)) <= {Reason.VALID, Reason.NO_HIT}


def test_a_profile_repeats_with_its_brightness(view_of):
    view = view_of("bench", y_mm=np.linspace(-24.7, 24.6, 200))
    depth, _ = RowRepeat(share=0.4).apply(geometric_law(view, FIELD), view).sample(streams(6), view)
    levels = np.random.default_rng(1).integers(1, 255, view.shape, dtype=np.uint8)
    delivered = brightness_delivered(levels, depth)
    again = repeated_rows(depth)
    assert again.sum() > 50
    assert np.array_equal(delivered[1:][again[1:]], delivered[:-1][again[1:]])
    assert np.array_equal(delivered[~again], levels[~again])
