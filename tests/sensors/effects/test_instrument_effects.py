"""Effects of the instrument's calibration, camera and optics against closed forms."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import erf, ndtr

from sensors.effects.axis_quantisation import AxisQuantisation
from sensors.effects.column_offset import ColumnOffset
from sensors.effects.incidence_bias import IncidenceBias
from sensors.effects.lateral_error import LateralError
from sensors.effects.lens_distortion import LensDistortion
from sensors.effects.light_falloff import LightFalloff
from sensors.effects.line_bow import LineBow
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.pixel_locking import PixelLocking
from sensors.effects.range_scale import RangeScale
from sensors.law import geometric_law
from sensors.view.camera import depth_per_row, row_of_depth
from sensors.view.covariates import COVARIATES


def test_bow_is_its_sag_at_the_ends(view_of):
    view = view_of("plate")
    change = LineBow(sag_um=30.0).signature(view)
    assert np.allclose(change[:, [0, -1]], 0.030)
    assert np.allclose(change, 0.030 * (view.x_mm / 30.0) ** 2)


def test_effects_of_the_place_along_the_line_count_from_the_optical_axis(view_of):
    """An axis at 10 mm: what stood at x stands at x + 10, to the bit at an axis of 0."""
    plain, moved = view_of("plate"), view_of("plate", sheet={"optical_axis_x_mm": 10.0})
    np.testing.assert_array_equal(plain.off_axis_mm, plain.x_mm)
    np.testing.assert_array_equal(moved.x_mm, plain.x_mm)  # columns of parallel rays stay
    x = plain.x_mm - 10.0
    bow = LineBow(sag_um=30.0).signature(moved)
    np.testing.assert_allclose(bow, 0.030 * (x / 30.0) ** 2, atol=1e-12)
    cubic = LensDistortion(tilt_um=0.0, cubic_um=20.0).signature(moved)
    np.testing.assert_allclose(cubic, 0.020 * (x / 30.0) ** 3, atol=1e-12)
    light = LightFalloff(ends=0.3).log_signal(moved)
    np.testing.assert_allclose(light, math.log(0.3) * (x / 30.0) ** 2, atol=1e-12)
    np.testing.assert_allclose(COVARIATES["x"].values(moved), x)


def test_distortion_is_odd_in_x_and_turns_with_the_sensor(view_of):
    view = view_of("plate", height_mm=225.0)
    tilt = LensDistortion(tilt_um=20.0, cubic_um=0.0).signature(view)
    cubic = LensDistortion(tilt_um=0.0, cubic_um=20.0).signature(view)
    assert np.allclose(tilt[:, -1], 0.020 * 25.0 / 50.0)
    assert np.allclose(cubic[:, -1], 0.020)
    for change in (tilt, cubic):
        assert np.allclose(change, -change[:, ::-1])
    part_x = view.part_mm[..., 0]
    turned = view_of("plate", height_mm=225.0, turned=True)
    other = LensDistortion(tilt_um=20.0, cubic_um=0.0).signature(turned)
    assert np.allclose(np.sign(tilt), -np.sign(part_x))
    assert np.allclose(np.sign(other), np.sign(turned.part_mm[..., 0]))


def test_scale_is_proportional_to_the_distance_from_mid_range(view_of):
    for height in (180.0, 200.0, 230.0):
        view = view_of("plate", height_mm=height)
        change = RangeScale(error_ppm=500.0).signature(view)
        assert np.allclose(change, 5e-4 * (height - 200.0), atol=1e-12)


def test_columns_keep_their_offsets_in_every_profile_and_pose(view_of):
    effect = ColumnOffset(rms_um=4.0, seed=7)
    flat = effect.signature(view_of("plate"))
    tilted = effect.signature(view_of("plate", solid={"tilt_x_deg": 10.0}))
    assert np.ptp(flat, axis=0).max() < 1e-12
    assert np.allclose(flat[0], tilted[0], atol=1e-12)
    wide = view_of("plate", sheet={"points_per_profile": 20000})
    many = effect.fields(wide)
    assert np.isclose(many[0].std(), 1e-3, rtol=0.02)
    other = ColumnOffset(rms_um=4.0, seed=8).signature(view_of("plate"))
    assert abs(np.corrcoef(flat[0], other[0])[0, 1]) < 0.5


def test_column_values_are_joined_by_straight_lines(view_of):
    effect = ColumnOffset(values_um=(0.0, 10.0, -10.0))
    change = effect.signature(view_of("plate", sheet={"points_per_profile": 81}))[0]
    assert np.allclose(change[[0, 20, 40, 60, 80]], [0, 0.005, 0.010, 0.0, -0.010], atol=1e-12)
    assert "8.2 µm" in effect.describe()


def test_columns_have_their_own_scales_from_the_working_distance_on(view_of):
    effect = ColumnOffset(scales_ppm=(0.0, 1000.0, -1000.0))
    for away in (-20.0, 0.0, 15.0):
        view = view_of("plate", height_mm=200.0 + away, sheet={"points_per_profile": 81})
        change = effect.signature(view)[:, [0, 20, 40, 60, 80]]
        assert np.allclose(change, 1e-3 * away * np.array([0, 0.5, 1.0, 0.0, -1.0]), atol=1e-12)
    assert "816 ppm" in effect.describe()


@pytest.mark.parametrize("side", ["+y", "-y"])
def test_rows_are_a_pinholes(view_of, side):
    """The row agrees with a projection by vectors."""
    sheet = view_of("plate", sheet={"camera_side": side}).datasheet
    camera = np.array([0.0, sheet.camera_offset_mm, 0.0])
    axis = np.array([0.0, 0.0, 200.0]) - camera
    axis /= np.linalg.norm(axis)
    up = np.cross([1.0, 0.0, 0.0], axis)

    def height(z):
        way = np.array([17.0, 0.0, z]) - camera
        return (way @ up) / (way @ axis)

    first, last = height(150.0), height(250.0)
    for z in (160.0, 200.0, 240.0):
        expected = 512 * (height(z) - first) / (last - first)
        assert np.isclose(row_of_depth(np.float64(z), sheet, 512), expected, rtol=1e-9)
        step = 1e-4
        rise = row_of_depth(np.array([z - step, z + step]), sheet, 512)
        span = depth_per_row(np.float64(z), sheet, 512)
        assert np.isclose(span, 2 * step / np.ptp(rise), rtol=1e-6)


def test_locking_repeats_with_the_rows(view_of):
    view = view_of("plate", solid={"tilt_x_deg": 20.0}, sheet={"points_per_profile": 4000})
    effect = PixelLocking(amplitude_px=0.05, phase_rad=0.3)
    change = effect.signature(view)[0]
    row = row_of_depth(view.depth_mm, view.datasheet, 512)[0]
    per_row = depth_per_row(view.depth_mm, view.datasheet, 512)[0]
    assert np.allclose(change, 0.05 * per_row * np.sin(2 * np.pi * row + 0.3), atol=1e-9)
    assert np.isclose(np.abs(change / per_row).max(), 0.05, rtol=1e-3)
    crossings = np.sum((change[1:] > 0) != (change[:-1] > 0))
    assert abs(crossings - 2 * np.ptp(row)) <= 1


def test_noise_passes_through_a_locked_row(view_of):
    """A row scattered by δ is located at v + δ + A sin 2π(v + δ): its spread is the slope's."""
    view = view_of("plate", solid={"tilt_x_deg": 5.0}, sheet={"camera_rows": 512})
    effect = PixelLocking(amplitude_px=0.05, phase_rad=0.3)
    plain = dataclasses.replace(geometric_law(view, None), white_sd_mm=0.002)
    law = effect.apply(plain, view)
    row = row_of_depth(view.depth_mm, view.datasheet, 512)
    delta = 1e-4

    def located(v):
        return v + 0.05 * np.sin(2 * np.pi * v + 0.3)

    slope = (located(row + delta) - located(row - delta)) / (2 * delta)
    assert np.allclose(law.white_sd_mm, 0.002 * slope, rtol=1e-5)
    assert np.allclose(law.speckle_gain, slope, rtol=1e-5)


def test_locking_of_a_centre_of_gravity(view_of):
    """Amplitude e^(-2π²σ²)/π px for a centre of gravity over whole pixels, spot width σ."""
    edges = np.arange(-30, 32) - 0.5
    pixels = np.arange(-30, 31)
    places = np.linspace(-0.5, 0.5, 401)[:-1]
    for sigma in (0.3, 0.4, 0.5):
        light = np.diff(ndtr((edges[None, :] - places[:, None]) / sigma), axis=1)
        error = light @ pixels - places
        amplitude = 2 * np.mean(error * np.sin(2 * np.pi * places))
        assert np.isclose(abs(amplitude), math.exp(-2 * np.pi**2 * sigma**2) / np.pi, rtol=1e-3)


def test_locking_without_rows_searches_them(view_of):
    view = view_of("plate", solid={"tilt_x_deg": 20.0}, sheet={"camera_rows": None})
    grid = PixelLocking(amplitude_px=0.05).grid(view)
    rows = np.array([effect.rows for effect in grid])
    part = np.ptp(row_of_depth(view.depth_mm, view.datasheet, 1.0))
    cycles = part * np.diff(rows)
    assert len(grid) > 50
    assert np.all(cycles <= 0.51)


@pytest.mark.parametrize("tilt", [30.0, -30.0])
def test_bias_follows_the_signed_slope(view_of, tilt):
    view = view_of("plate", solid={"tilt_y_deg": tilt})
    change = IncidenceBias(signed_um=20.0, squared_um=0.0).signature(view)
    # the plate rises along y, so depth falls along the sensor's y, which is the part's
    assert np.allclose(change, -0.020 * math.tan(math.radians(tilt)))
    turned = view_of("plate", solid={"tilt_y_deg": tilt}, turned=True)
    assert np.allclose(IncidenceBias(signed_um=20.0, squared_um=0.0).signature(turned), -change)
    squared = IncidenceBias(signed_um=0.0, squared_um=10.0)
    assert np.allclose(squared.signature(view), 0.010 * math.tan(math.radians(tilt)) ** 2)
    assert np.allclose(squared.signature(turned), squared.signature(view))


def test_bias_stays_finite_on_walls(view_of):
    view = view_of("step", sheet={"columns": "even_angle"}, y_mm=np.linspace(-12, 12, 50))
    assert np.isfinite(IncidenceBias().signature(view)[view.in_range]).all()


def test_locking_follows_the_bent_image_of_a_level_line(view_of):
    view = view_of("plate")
    straight = PixelLocking(amplitude_px=0.05, rows=100.0)
    bent = PixelLocking(amplitude_px=0.05, rows=100.0, smile_rows=0.5)
    across = view.column_x_mm / np.abs(view.column_x_mm).max()
    sine, cosine = straight.fields(view)
    turn = 2 * math.pi * 0.5 * across**2
    assert np.allclose(bent.fields(view)[0], sine * np.cos(turn) + cosine * np.sin(turn))
    # half a row at the ends turns the ripple over
    assert np.allclose(bent.signature(view)[:, 0], -straight.signature(view)[:, 0])


def test_blur_averages_what_the_line_s_width_does_on_its_way(view_of):
    """Spot and way together round a crease by less than the sum of both; no camera, no light."""
    y = np.linspace(-3.0, 3.0, 601)
    spot = {"name": "finite_spot", "line_sd_um": 100.0}
    view = view_of("groove", y_mm=y, sheet={"effects": (spot,), "triangulation_angle_deg": None})
    step_ms = 1e3 * float(np.median(np.diff(view.time_s)))
    law = view.sensor.law(view, None)
    both = MotionBlur(exposure_ms=40 * step_ms).apply(law, view).mean_mm[:, 40]
    way = 40 * 0.01
    # E |y + u| over a Gaussian of 0.1 mm and a box of 0.4 mm, at the box's middle on the crease
    u = np.linspace(-way / 2, way / 2, 4001)
    spread = np.sqrt(2 / np.pi) * 0.1 * np.exp(-(u**2) / 0.02) + u * erf(u / np.sqrt(0.02))
    assert np.isclose(220.0 - both.max(), spread.mean(), atol=0.004)


@pytest.mark.parametrize("columns", ["even_x", "even_angle"])
@pytest.mark.parametrize("height_mm", [180.0, 200.0, 225.0])
def test_error_of_x_is_depth_on_a_slope(view_of, columns, height_mm):
    """δz = δx p / (1 - p s): the ray, of slope s, is beside its own by δx at the depth it reads."""
    view = view_of(
        "plate", solid={"tilt_x_deg": 20.0}, sheet={"columns": columns}, height_mm=height_mm
    )
    effect = LateralError(offset_um=30.0, scale_um=50.0, shear_um=-40.0)
    change, seen = effect.signature(view), view.in_range
    u = view.column_x_mm / 30.0
    w = (view.depth_mm - 200.0) / 50.0
    lateral = 0.030 + 0.050 * u - 0.040 * u * w
    expected = lateral * view.slope_x / (1 - view.slope_x * view.laser.slope_x)
    assert np.abs(change[seen]).max() > 0.005
    assert np.allclose(change[seen], expected[seen], atol=5e-5)


def test_error_of_x_is_nothing_on_slopes_of_the_travel(view_of):
    change = LateralError(scale_um=500.0).signature(view_of("plate", solid={"tilt_y_deg": 30.0}))
    assert np.nanmax(np.abs(change)) < 1e-9


def test_error_of_x_displaces_an_edge_whole(view_of):
    """A step 10 mm high at x = 15 mm: readings between stated and true edge change their level."""
    view = view_of("step", sheet={"points_per_profile": 1201})
    change = LateralError(offset_um=400.0, scale_um=0.0, shear_um=0.0).signature(view)
    row = np.abs(view.poses[:, 1, 3]).argmin()
    moved = np.flatnonzero(np.abs(change[row]) > 5.0)
    at_mm = np.abs(view.column_x_mm[moved])
    assert np.all((at_mm > 14.59) & (at_mm < 15.41))
    assert np.isclose(moved.size, 2 * 0.4 / 0.05, atol=2)


def test_light_falls_off_as_a_gaussian_of_x(view_of):
    """Middle and ends of the line; half of the share is missing where S is the threshold."""
    view = view_of("plate", sheet={"points_per_profile": 121})
    effect = LightFalloff(ends=0.25, share=0.8, threshold=0.25, softness=0.1)
    bare = geometric_law(view, None)
    law = effect.apply(bare, view)
    assert np.allclose(law.p_missing[:, [0, -1]], 0.4)
    assert np.all(law.p_missing[:, 60] < 1e-5)
    gain = law.sd_mm(view) / bare.sd_mm(view)
    assert np.allclose(gain[:, [0, -1]], 2.0)  # a quarter of the photons
    assert np.allclose(gain[:, 60], 1.0)
    assert np.allclose(gain[:, 30], 0.25 ** (-0.5 * 0.25))  # half way, a quarter of the exponent
    shifted = effect.with_parameters(middle_mm=15.0).apply(bare, view)
    assert np.isclose(shifted.sd_mm(view)[0, 90], bare.sd_mm(view)[0, 90])
    assert np.all(shifted.p_missing[:, 0] > 0.79)


@pytest.mark.parametrize("step_um", [0.5, 20.0, 100.0])
def test_depths_are_multiples_of_the_coarser_step(view_of, rng_of, step_um):
    view = view_of("plate", solid={"tilt_y_deg": 5.0})  # its own ΔZ is 2 µm
    law = AxisQuantisation(step_um=step_um).apply(geometric_law(view, None), view)
    depth, _ = law.sample(rng_of, view)
    step_mm = 1e-3 * max(step_um, 2.0)
    assert np.allclose(depth / step_mm, np.rint(depth / step_mm), atol=1e-6)
    error = depth - view.depth_mm
    expected = np.hypot(law.sd_mm(view)[0, 0], step_mm / math.sqrt(12))
    assert np.isclose(error.std(), expected, rtol=0.05)
