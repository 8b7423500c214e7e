"""Effects of motion, time and the part's own form against closed forms."""

import math

import numpy as np
import pytest

from sensors.effects.form_error import FormError, orders
from sensors.effects.pose_error import PoseError
from sensors.effects.stage_vibration import StageVibration
from sensors.effects.thermal_drift import ThermalDrift
from sensors.effects.travel_ripple import TravelRipple
from sensors.law import geometric_law
from sensors.view.rigid import rigid_jacobian


def test_vibration_moves_whole_rows_at_its_frequency(view_of):
    view = view_of("step", y_mm=np.linspace(-25, 25, 200))
    change = StageVibration(amplitude_um=10.0, frequency_hz=12.5, phase_rad=0.4).signature(view)
    rows = np.nanmean(change, axis=1)
    assert np.nanmax(np.abs(change - rows[:, None])) < 1e-12
    assert np.allclose(rows, 0.010 * np.sin(2 * np.pi * 12.5 * view.time_s + 0.4))
    spectrum = np.abs(np.fft.rfft(rows))
    assert np.fft.rfftfreq(200, 0.01)[np.argmax(spectrum)] == 12.5


def test_vibration_above_half_the_profile_rate_is_aliased(view_of):
    view = view_of("plate", y_mm=np.linspace(-25, 25, 200))
    above = StageVibration(amplitude_um=10.0, frequency_hz=87.5, phase_rad=0.0).signature(view)
    below = StageVibration(amplitude_um=10.0, frequency_hz=12.5, phase_rad=math.pi).signature(view)
    assert np.allclose(above, below, atol=1e-12)


def test_vibration_of_unknown_phase_is_integrated_out(view_of):
    view = view_of("plate")
    law = geometric_law(view, None)
    spread = StageVibration(amplitude_um=10.0, frequency_hz=25.3).apply(law, view)
    assert np.allclose(spread.mean_mm, law.mean_mm, atol=1e-12)
    assert np.allclose(np.square(spread.white_sd_mm) - law.white_sd_mm**2, 0.010**2 / 2)


def test_vibration_is_searched_half_a_resolution_apart(view_of):
    view = view_of("plate", y_mm=np.linspace(-25, 25, 100))
    frequencies = np.array([e.frequency_hz for e in StageVibration().grid(view)])
    assert np.allclose(np.diff(frequencies), 0.5 / 0.99)
    assert 49 < frequencies[-1] < 50


def test_ripple_shows_on_slopes_alone(view_of):
    effect = TravelRipple(amplitude_um=50.0, period_mm=10.0, phase_rad=0.0)
    assert np.abs(effect.signature(view_of("plate"))).max() < 1e-12
    for turned in (False, True):
        view = view_of("plate", solid={"tilt_y_deg": 30.0}, turned=turned)
        change = effect.signature(view)
        travel = view.travel_mm[:, None]
        place = 0.050 * np.sin(2 * np.pi * travel / 10.0)  # along the sensor's y
        assert np.allclose(change, view.slope_y * place, atol=1e-9)


def test_ripple_moves_edges(view_of):
    """A profile displaced over the block's edge reads the other level: no linearising there."""
    y = np.array([9.98, 10.02])
    view = view_of("step", y_mm=y)
    forward = TravelRipple(amplitude_um=50.0, period_mm=0.16, phase_rad=math.pi / 2)
    assert np.allclose(view.depth_mm[:, 40], [190.0, 200.0])
    assert np.isclose(forward.moved(view).depth_mm[0, 40], 200.0)


def test_drift_follows_the_common_clock(view_of):
    effect = ThermalDrift(amplitude_um=40.0, time_constant_s=100.0)
    for start in (0.0, 100.0, 300.0):
        view = view_of("plate", start_time_s=start)
        assert effect.undrawn(view) == ()
        expected = 0.040 * (1 - np.exp(-(start + view.time_s) / 100.0))
        assert np.allclose(effect.signature(view), expected[:, None])
    assert effect.undrawn(view_of("plate")) == ("elapsed_s",)
    without = ThermalDrift(amplitude_um=40.0, time_constant_s=100.0, elapsed_s=300.0)
    assert np.allclose(without.signature(view_of("plate")), effect.signature(view))


def test_drift_of_unknown_age_is_integrated_out(view_of):
    view = view_of("plate")
    effect = ThermalDrift(amplitude_um=40.0, time_constant_s=600.0)
    law = effect.apply(geometric_law(view, None), view)
    ages = (np.arange(8) + 0.5) / 8 * 1800.0
    offsets = 0.040 * (1 - np.exp(-ages / 600.0))
    assert np.allclose(law.mean_mm[0] - view.depth_mm[0], offsets.mean())
    white = geometric_law(view, None).white_sd_mm
    assert np.allclose(np.square(law.white_sd_mm)[0], white**2 + offsets.var())


@pytest.mark.parametrize(
    ("name", "value", "slope_x", "slope_y"),
    [("roll_deg", 0.5, 1, 0), ("pitch_deg", 0.5, 0, -1), ("yaw_deg", 0.5, 0, 0)],
)
def test_turns_tilt_a_flat_plate(view_of, name, value, slope_x, slope_y):
    """Rolled about +y, x = z × y leans... the surface's depth rises along +x by tan(roll)."""
    view = view_of("plate")
    true = PoseError(**{"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, name: value}).moved(view)
    tangent = math.tan(math.radians(value))
    assert np.allclose(true.slope_x, slope_x * tangent, atol=1e-12)
    assert np.allclose(true.slope_y, slope_y * tangent, atol=1e-12)


def test_offsets_of_the_mounting(view_of):
    view = view_of("plate", solid={"tilt_y_deg": 20.0, "tilt_x_deg": 10.0})
    zero = {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}
    for name, change in (
        ("z_mm", -1.0), ("y_mm", view.slope_y), ("x_mm", view.slope_x)
    ):  # fmt: skip
        assert np.allclose(PoseError(**zero, **{name: 1.0}).signature(view), change, atol=1e-9)


@pytest.mark.parametrize("columns", ["even_x", "even_angle"])
def test_first_order_of_pose_and_ripple(view_of, columns):
    """The basis is the derivative of what the effect does, on slopes and in a fan."""
    tilts = {"tilt_y_deg": 25.0, "tilt_x_deg": 15.0}
    view = view_of("plate", solid=tilts, sheet={"columns": columns})
    small = np.array([1, -2, 1.5, 3, -2, 1]) * 1e-4
    effect = PoseError().with_coefficients(small)
    basis = effect.basis(view)
    assert basis is not None
    first = sum(c * f for c, f in zip(small, basis.fields, strict=True))
    assert np.allclose(effect.signature(view), first, atol=2e-7)
    ripple = TravelRipple(amplitude_um=1.0, period_mm=7.0, phase_rad=1.0)
    basis = ripple.basis(view)
    assert basis is not None
    first = sum(c * f for c, f in zip(ripple.coefficients(), basis.fields, strict=True))
    assert np.allclose(ripple.signature(view), first, atol=1e-9)


def test_jacobian_agrees_with_casting_again(view_of):
    view = view_of("plate", solid={"tilt_y_deg": -20.0}, sheet={"columns": "even_angle"})
    push = rigid_jacobian(view)
    step = 1e-3
    for axis, shift in enumerate(({"dx_mm": step}, {"dy_mm": step}, {"dz_mm": step})):
        change = view.shifted(**shift).depth_mm - view.depth_mm
        assert np.allclose(change, step * push[axis], atol=1e-9)


def test_form_moves_with_the_part(view_of):
    """The same points of the part read the same error from any pose."""
    effect = FormError(coefficients_um=(10.0, -20.0, 40.0, 20.0, -40.0))
    y = np.linspace(-20, 20, 41)
    one, turned = view_of("plate", y_mm=y), view_of("plate", y_mm=y, turned=True)
    assert np.allclose(one.part_mm[:, ::-1], turned.part_mm)
    assert np.allclose(effect.signature(one)[:, ::-1], effect.signature(turned), atol=1e-12)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0])
def test_a_mount_that_warms_moves_the_sensor_along_its_axis(view_of, tilt_deg):
    """Exact on planes; creeping readings differ from it where slanted rays meet a slope."""
    view = view_of("plate", solid={"tilt_x_deg": tilt_deg}, sheet={"columns": "even_angle"})
    age_s = 100.0 + view.time_s
    effect = ThermalDrift(
        amplitude_um=500.0, time_constant_s=60.0, elapsed_s=100.0, shifts="sensor"
    )
    poses = view.poses.copy()
    poses[:, :3, 3] += 0.5 * np.expm1(-age_s / 60.0)[:, None] * poses[:, :3, 2]
    both = view.in_range & view.posed(poses).in_range
    moved = (view.posed(poses).depth_mm - view.depth_mm)[both]
    assert np.allclose(effect.signature(view)[both], moved, atol=1e-9)
    reading = effect.with_parameters(shifts="reading").signature(view)[both]
    assert np.allclose(reading, moved, atol=1e-9) == (tilt_deg == 0.0)


def test_form_is_a_cosine_series_along_the_shortest_side(view_of):
    assert orders(5) == [(0, 1), (1, 0), (0, 2), (1, 1), (2, 0)]
    plate = view_of("plate")
    for index, (i, j) in enumerate(orders(5)):
        effect = FormError(coefficients_um=tuple(100.0 * (k == index) for k in range(5)))
        u, v = (plate.part_mm[..., :2] + 150.0).transpose(2, 0, 1) / 300.0
        expected = -0.1 * np.cos(i * np.pi * u) * np.cos(j * np.pi * v)
        assert np.allclose(effect.signature(plate), expected, atol=1e-12)


def test_the_size_of_a_form_leaves_out_what_turns_the_part():
    """A cosine's mean square is 1/2; a plane takes 96 / π⁴ of half a wave, nothing of a whole."""
    half, whole = FormError(coefficients_um=(100.0,)), FormError(coefficients_um=(0.0, 0.0, 100.0))
    assert half.bent_um() == pytest.approx(100 * math.sqrt(0.5 * (1 - 96 / math.pi**4)), rel=0.01)
    assert whole.bent_um() == pytest.approx(100 / math.sqrt(2), rel=1e-9)
    # two large waves that draw a plane between them bend nothing much
    odd = [1 / k**2 if k % 2 else 0.0 for k in range(1, 8)]
    series = dict(zip([(0, k) for k in range(1, 8)], odd, strict=True))
    plane = FormError(coefficients_um=tuple(5000.0 * series.get(o, 0.0) for o in orders(44)))
    assert plane.bent_um() < 0.02 * 5000


@pytest.mark.parametrize("tilt_deg", [20.0, 40.0])
def test_form_seen_along_it_is_the_same_on_every_slope(view_of, tilt_deg):
    """Walls are carried along, they don't grow outwards."""
    view = view_of("plate", solid={"tilt_y_deg": tilt_deg})
    low, high = view.scene.vertices_mm.min(axis=0), view.scene.vertices_mm.max(axis=0)
    v = (view.part_mm[..., 1] - low[1]) / (high[1] - low[1])
    change = FormError(coefficients_um=(0.0, 0.0, 100.0)).signature(view)
    assert np.allclose(change, -0.1 * np.cos(2 * np.pi * v), atol=1e-9)


def test_form_moves_what_it_displaces_along_the_ray(view_of):
    """A slanted sensor: the displaced plane is met n·w / (n·d) times the displacement earlier."""
    straight = view_of("plate")
    turn = np.eye(4)
    turn[:3, :3] = [
        [1, 0, 0], [0, math.cos(0.5), -math.sin(0.5)], [0, math.sin(0.5), math.cos(0.5)]
    ]  # fmt: skip
    slanted = straight.posed(straight.poses @ turn)
    effect = FormError(coefficients_um=(100.0,))
    v = (slanted.part_mm[..., 1] + 150.0) / 300.0
    expected = -0.1 * np.cos(np.pi * v) / math.cos(0.5)
    seen = slanted.in_range
    assert np.allclose(effect.signature(slanted)[seen], expected[seen], atol=1e-9)


def test_a_drift_faster_than_a_second_is_told_with_its_time_constant():
    told = ThermalDrift(amplitude_um=12.0, time_constant_s=0.332).describe()
    assert "0.332 s" in told
    assert "1200 s" in ThermalDrift(amplitude_um=12.0, time_constant_s=1200.0).describe()
