"""Laws of readings and draws from them."""

import dataclasses
import math

import numpy as np
import pytest

from sensors.effects.camera_occlusion import CameraOcclusion
from sensors.effects.line_bow import LineBow
from sensors.effects.pose_error import PoseError
from sensors.effects.stage_vibration import StageVibration
from sensors.effects.travel_ripple import TravelRipple
from sensors.law import Law, geometric_law
from sensors.model import SensorModel, scan_with
from sensors.noise.perlin import PerlinField
from sensors.noise.uncertainty import sigma_mm
from sensors.surface.surface import Surface
from sensors.view.view import Reason, View

FIELD = PerlinField(amplitude_mm=0.05, cell_x_mm=3.0, cell_y_mm=3.0)
PERFECT = {"z_resolution_um": 0.0, "repeatability_um": 0.0}


def streams(seed):
    return lambda name: np.random.default_rng([seed, *map(ord, name)])


def listed(view, *effects):
    sheet = dataclasses.replace(view.datasheet, effects=tuple(e.to_mapping() for e in effects))
    return View(view.scene, SensorModel(sheet), view.poses, view.time_s, laser=view.laser)


def test_trivial_sensor_is_no_sensor(view_of, rng_of):
    view = view_of("step", sheet=PERFECT)
    depth, reason = view.sensor.law(view, None).sample(rng_of, view)
    assert depth.tobytes() == view.depth_mm.tobytes()
    assert np.array_equal(reason, view.reason)


def test_perfect_sensor_asks_for_no_random_numbers(view_of):
    view = view_of("step", sheet=PERFECT)

    def refuse(name):
        raise AssertionError(f"stream {name} drawn")

    view.sensor.law(view, None).sample(refuse, view)


def test_readings_are_multiples_of_the_step(view_of, rng_of):
    view = view_of("cylinder", sheet={"z_resolution_um": 20.0, "repeatability_um": 0.0})
    law = view.sensor.law(view, FIELD)
    depth, _ = law.sample(rng_of, view)
    counts = depth[np.isfinite(depth)] / 0.020
    assert np.abs(counts - np.rint(counts)).max() < 1e-6


def test_noise_before_rounding_is_equation_10(view_of):
    sheet = {"z_resolution_um": 6.0, "repeatability_um": 8.0, "points_per_profile": 2000}
    view = view_of("plate", sheet=sheet)
    law = dataclasses.replace(view.sensor.law(view, None), step_mm=0.0)
    sigma = math.hypot(0.006 / math.sqrt(12), 0.008)
    assert np.isclose(sigma_mm(view.datasheet), sigma)
    depth, _ = law.sample(streams(0), view)
    residual = depth - view.depth_mm
    assert np.isclose(residual.std(), sigma, rtol=5 / math.sqrt(2 * residual.size))
    assert abs(residual.mean()) < 5 * sigma / math.sqrt(residual.size)


def test_draw_doesnt_depend_on_other_streams(view_of):
    """Adding outliers or dropouts shifts no other draw."""
    view = view_of("plate")
    law = view.sensor.law(view, FIELD)
    more = dataclasses.replace(law, p_outlier=0.01, outlier_sd_mm=1.0, p_missing=0.1)
    one, _ = law.sample(streams(0), view)
    two, reason = more.sample(streams(0), view)
    same = one == two
    assert np.isclose(same.mean(), 0.9 * 0.99, atol=0.02)
    assert np.isnan(two[reason == Reason.DROPOUT]).all()


def test_speckle_comes_in_whole(view_of):
    view = view_of("plate", sheet=PERFECT)
    depth, _ = view.sensor.law(view, FIELD).sample(streams(0), view)
    drawn = FIELD.sample(view.column_x_mm, view.travel_mm, streams(0)("speckle"))
    assert np.allclose(depth - view.depth_mm, drawn, atol=1e-12)


def test_claimed_deviation_of_the_speckle(view_of):
    view = view_of("plate", sheet={"points_per_profile": 400}, y_mm=np.linspace(-60, 60, 400))
    law = view.sensor.law(view, FIELD)
    draws = np.concatenate([law.sample(streams(s), view)[0] - view.depth_mm for s in range(3)])
    assert np.isclose(draws.std(), law.sd_mm(view)[0, 0], rtol=0.03)


def test_surface_gives_its_own_field(view_of):
    surface = Surface.load("car_door").ready()
    view = view_of("plate")
    law = view.sensor.law(view, surface)
    assert law.speckle == surface.field()
    assert 0.005 < law.speckle_sd_mm(view) < 0.05


def test_what_noise_takes_out_of_range_is_missing(view_of):
    view = view_of("plate", height_mm=250.0)
    depth, reason = view.sensor.law(view, FIELD).sample(streams(0), view)
    out = reason == Reason.OUT_OF_RANGE
    assert 0.3 < out.mean() < 0.7
    assert np.isnan(depth[out]).all()
    assert np.nanmax(depth) <= 250.0


def test_effects_of_the_sheet_come_in_order(view_of):
    view = listed(view_of("step"), LineBow(sag_um=50.0), CameraOcclusion())
    law = view.sensor.law(view, None)
    assert np.array_equal(law.reason == Reason.HIDDEN_FROM_CAMERA, view.in_range & ~view.visible)
    seen = view.visible
    assert np.allclose((law.mean_mm - view.depth_mm)[seen], (0.05 * (view.x_mm / 30) ** 2)[seen])


def test_a_moved_sensor_moves_everything(view_of):
    """Shadows belong to where the sensor is, wherever in the list its pose error stands."""
    pose = PoseError(roll_deg=0.0, pitch_deg=2.0, yaw_deg=0.0)
    for effects in ((pose, CameraOcclusion()), (CameraOcclusion(), pose)):
        view = listed(view_of("step"), *effects)
        law = view.sensor.law(view, None)
        true = view.sensor.scan(view, None)[0]
        assert np.allclose(true.poses, pose.moved(view).poses)
        expected = np.where(true.visible, true.depth_mm, np.nan)
        assert np.array_equal(law.mean_mm, expected, equal_nan=True)
    bare = listed(view_of("step"), CameraOcclusion())
    assert bare.sensor.scan(bare, None)[0] is bare


def test_recordings_draw_their_own_parameters(view_of):
    view = listed(
        view_of("plate", solid={"tilt_y_deg": 20.0}),
        StageVibration(amplitude_um=50.0, frequency_hz=7.0),
        TravelRipple(amplitude_um=100.0, period_mm=8.0),
    )
    one, same, other = (view.sensor.law(view, None, streams(s)).mean_mm for s in (1, 1, 2))
    assert np.array_equal(one, same)
    assert np.abs(one - other).max() > 0.02
    true, law = view.sensor.scan(view, None, streams(1))
    vibration = [StageVibration(amplitude_um=50.0, frequency_hz=7.0)]
    _, moved = scan_with(true, None, vibration, streams(1))
    assert np.allclose(moved.mean_mm, one, atol=1e-12)
    assert np.array_equal(law.mean_mm, one)
    unknown = view.sensor.law(view, None)
    assert np.allclose(unknown.mean_mm, view.depth_mm, atol=1e-3)
    assert np.mean(np.square(unknown.white_sd_mm)) > 0.05**2 / 2


def test_mixture_of_laws():
    mean, reason = np.array([[1.0, np.nan, 3.0]]), np.zeros((1, 3), np.uint8)
    one = Law(mean_mm=mean, reason=np.array([[0, 1, 0]], np.uint8), white_sd_mm=0.3)
    two = Law(mean_mm=np.array([[3.0, np.nan, np.nan]]), reason=reason + 1, white_sd_mm=0.4)
    two = dataclasses.replace(two, reason=np.array([[0, 1, 2]], np.uint8))
    mixed = Law.average([one, two])
    assert np.allclose(mixed.mean_mm, [[2.0, np.nan, 3.0]], equal_nan=True)
    assert np.allclose(np.square(mixed.white_sd_mm)[0, [0, 2]], [1.125, 0.125])
    assert np.allclose(np.asarray(mixed.p_missing)[0, [0, 2]], [0.0, 0.5])
    assert np.array_equal(mixed.reason, [[0, 1, 0]])


@pytest.mark.parametrize("profiles", [1, 2])
def test_shortest_scans(view_of, profiles):
    view = listed(view_of("plate", y_mm=np.arange(profiles)), LineBow(), CameraOcclusion())
    depth, _ = view.sensor.law(view, FIELD).sample(streams(0), view)
    assert np.isfinite(depth).all()


def test_geometric_law_has_no_effects(view_of):
    view = listed(view_of("step"), CameraOcclusion())
    assert np.array_equal(geometric_law(view, None).reason, view.reason)
