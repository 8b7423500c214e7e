"""What light meets on its way in the second family, against closed forms."""

from dataclasses import replace
from math import cos, pi, radians, sin, sqrt, tan

import numpy as np
import pytest

from challenge.instrument.instrument import Solid
from challenge.instrument.rays import plant
from challenge.second.bounce import RAYS, second_light
from challenge.second.camera import Camera
from challenge.second.coating import Film, Turbid, apparent, fresnel, refracted
from challenge.second.device import Device, Travel
from challenge.second.exposures import Exposures
from challenge.second.facets import Facets
from challenge.second.firmware import Firmware
from challenge.second.robot import Robot
from challenge.second.slit import Slit
from challenge.second.window import MODES, Air, Window

THETA, DISTANCE = radians(27), 120.0
TO_CAMERA = np.array([0.0, sin(THETA), -cos(THETA)])


@pytest.fixture(scope="module")
def device():
    camera = Camera(theta_rad=THETA, side=1, rows=160, row_pitch_mm=0.035, columns=60, x_fov_mm=6.0)
    bare = Device(slit=Slit(width_mm=0.07, blur_mm=0.03, coherence=0.4), camera=camera,
                  firmware=Firmware(step_mm=2.5e-4), z_range_mm=8.0)  # fmt: skip
    return bare.calibrated(np.random.default_rng(0))


def travel(profiles=20, pitch=0.1, rate=100.0):
    return Travel(start=np.eye(4), profiles=profiles, pitch_mm=pitch, rate_hz=rate, start_s=0.0)


def level(height=0.0, slope=0.0):
    """Plate along the travel, or rising over it by `slope` for each mm of y."""
    y, x = np.array([-40.0, 40.0]), np.array([-20.0, 20.0])
    z = DISTANCE + height + (tan(THETA) + slope) * y
    corners = np.array([[a, b, c] for b, c in zip(y, z, strict=True) for a in x])
    return Solid(vertices_mm=corners, faces=np.array([[0, 2, 1], [1, 2, 3]]))


def scan(device, facets, path=None, solid=None):
    found, bright = device.scan(
        level() if solid is None else solid, facets, path or travel(), np.random.default_rng(1),
        specimen=5,
    )  # fmt: skip
    return found, bright


# --- coats


def test_snell_bends_towards_the_normal_and_an_index_of_one_bends_nothing():
    normal = np.array([0.0, 0.0, -1.0])
    for angle in (0.1, 0.7, 1.2):
        light = np.array([sin(angle), 0.0, cos(angle)])
        inside = refracted(light, normal, 1 / 1.5)
        assert inside[0] == pytest.approx(sin(angle) / 1.5)
        assert np.linalg.norm(inside) == pytest.approx(1.0)
        np.testing.assert_allclose(refracted(light, normal, 1.0), light, atol=1e-12)


@pytest.mark.parametrize("index", [1.0, 1.33, 1.5, 1.7])
def test_a_body_looks_shallower_by_the_ratio_of_the_tangents(index):
    normal = np.array([[0.0, 0.0, -1.0]])
    shift, path, inward = apparent(normal, TO_CAMERA, index)
    inside = np.arcsin(sin(THETA) / index)
    # the sight line through the shifted place crosses the sheet tan θ' / tan θ deep
    seen = shift[0, 2] + shift[0, 1] / tan(THETA)
    assert seen == pytest.approx(np.tan(inside) / tan(THETA))
    assert path[0] == pytest.approx(1 + 1 / cos(inside))
    assert inward[0] == pytest.approx(1.0)


def test_fresnel_at_normal_incidence_and_at_brewsters_angle():
    assert float(fresnel(np.array(1.0), 1.5)) == pytest.approx(0.04)
    brewster = np.arctan(1.5)
    # only s is left, half of the light: ((1 - n²) / (1 + n²))² / 2
    assert float(fresnel(np.cos(brewster), 1.5)) == pytest.approx((1.25 / 3.25) ** 2 / 2)
    assert float(fresnel(np.array(0.0), 1.5)) == pytest.approx(1.0)


def test_a_clear_coat_reads_nearer_by_its_thickness_less_its_apparent_depth(device):
    # a plate across the sheet, in range over a short path
    path, thick = travel(profiles=12, pitch=0.05), 0.06
    flat = Solid(
        vertices_mm=np.array([[x, y, DISTANCE] for y in (-40.0, 40.0) for x in (-20.0, 20.0)]),
        faces=np.array([[0, 2, 1], [1, 2, 3]]),
    )
    matt = Facets(mirror=0.0, modes=1e6)
    bare, _ = scan(device, matt, path, flat)
    coated, _ = scan(device, replace(matt, coat=Film(thickness_mm=thick, index=1.5)), path, flat)
    inside = np.arcsin(sin(THETA) / 1.5)
    nearer = thick * (1 - np.tan(inside) / tan(THETA))
    assert np.nanmean(bare - coated) == pytest.approx(nearer, rel=0.03)


def test_fringes_have_two_beams_contrast_and_fade_with_the_path():
    film = Film(thickness_mm=1e-3, mirror=0.1, coherence_mm=1e9)
    light = film.fringes(np.linspace(1e-3, 2e-3, 20000), np.array(1.0))
    outer = ((film.index - 1) / (film.index + 1)) ** 2
    contrast = (light.max() - light.min()) / (light.max() + light.min())
    assert contrast == pytest.approx(2 * sqrt(outer * 0.1), rel=1e-3)
    turns = (np.diff(np.sign(light - 1)) != 0).sum() / 2
    assert turns == pytest.approx(2 * film.index * 1e-3 / film.wavelength_mm, abs=1)
    thick = Film(thickness_mm=0.1).fringes(np.array([0.1, 0.1001]), np.array(1.0))
    np.testing.assert_allclose(thick, 1.0, atol=1e-9)


def test_rubber_reads_deeper_by_its_mean_apparent_depth(device):
    path = travel(profiles=12, pitch=0.05)
    flat = Solid(
        vertices_mm=np.array([[x, y, DISTANCE] for y in (-40.0, 40.0) for x in (-20.0, 20.0)]),
        faces=np.array([[0, 2, 1], [1, 2, 3]]),
    )
    matt, reach = Facets(mirror=0.0, modes=1e6, albedo=0.3), 0.02
    bare, _ = scan(device, matt, path, flat)
    body = Turbid(free_path_mm=reach, index=1.5)
    soft, _ = scan(device, replace(matt, coat=body), path, flat)
    inside = np.arcsin(sin(THETA) / 1.5)
    mean = reach / (1 + 1 / cos(inside)) * np.tan(inside) / tan(THETA)
    # the peak of a skewed line lies short of its centre of gravity
    deeper = float(np.nanmean(soft - bare))
    assert 0.5 * mean < deeper < 1.05 * mean


def test_all_light_that_enters_rubber_comes_from_some_depth():
    normal = np.array([[[0.0, 0.0, -1.0]]])
    layers = Turbid(free_path_mm=0.05).layers(normal, np.zeros((1, 1, 3)), TO_CAMERA)
    assert sum(float(layer.base[0, 0]) for layer in layers) == pytest.approx(1.0)
    _, path, _ = apparent(normal, TO_CAMERA, 1.5)
    shift, *_ = apparent(normal, TO_CAMERA, 1.5)
    mean = sum(float(layer.base[0, 0] * layer.deeper_mm[0, 0]) for layer in layers)
    assert mean == pytest.approx(0.05 / float(path[0, 0]) * float(shift[0, 0, 2]))


# --- second bounces


def two_walls(gap=4.0):
    """Build a mirror leaning at 45 degrees under the sheet, and an upright wall beside it."""
    half, tall = 50.0, 40.0
    lean = [[-half, -2.0, 98.0], [half, -2.0, 98.0], [-half, 2.0, 102.0], [half, 2.0, 102.0]]
    wall = [[x, gap, z] for z in (100 - tall, 100 + tall) for x in (-half, half)]
    faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6]]
    return Solid(vertices_mm=np.array(lean + wall), faces=np.array(faces))


def test_a_mirror_sends_the_line_where_the_law_of_reflection_says():
    solid = two_walls()
    tree = plant(solid.vertices_mm, solid.faces)
    x = np.linspace(-3, 3, 7)
    mirror = Facets(mirror=1.0, albedo=1e-9, slope_along=1e-6, slope_across=1e-6)
    towards = np.array([0.0, -sin(radians(60)), -cos(radians(60))])
    landed = second_light(tree, mirror, x, 0.5, towards, np.random.default_rng(0))
    # down the sheet at y = 0.5 it meets the leaning mirror at z = 100.5 and goes level to the wall
    assert len(landed.column) == RAYS * x.size
    np.testing.assert_allclose(landed.point[:, 1], 4.0, atol=1e-3)
    np.testing.assert_allclose(landed.point[:, 2], 100.5, atol=1e-3)
    np.testing.assert_allclose(landed.point[:, 0], x[landed.column], atol=1e-3)


def test_half_of_a_matt_floors_light_meets_an_endless_wall():
    # form factor of a floor element to an endless upright wall at its side: 1/2, but the camera
    # must see the place and does
    far = 1e5
    floor = [[-far, -3.0, 100.0], [far, -3.0, 100.0], [-far, far, 100.0], [far, far, 100.0]]
    wall = [[-far, -3.0, -far], [far, -3.0, -far], [-far, -3.0, 100.0], [far, -3.0, 100.0]]
    faces = np.array([[0, 2, 1], [1, 2, 3], [4, 6, 5], [5, 6, 7]])
    tree = plant(np.array(floor + wall), faces)
    x = np.linspace(-50, 50, 400)
    towards = np.array([0.0, sin(THETA), -cos(THETA)])
    matt = Facets(mirror=1e-9, albedo=1.0)
    landed = second_light(tree, matt, x, 0.0, towards, np.random.default_rng(0))
    assert len(landed.column) / (RAYS * x.size) == pytest.approx(0.5, abs=0.015)


# --- windows and air


def test_a_scratch_bends_sight_lines_by_its_depth_at_most_and_nothing_on_the_whole():
    window = Window(scratch_rows=0.3, scratch_mm=0.4, scratch_loss=0.5)
    x = np.linspace(-8, 8, 4001)
    bent, passed = window.seen(x, np.zeros_like(x))
    assert np.abs(bent).max() == pytest.approx(0.3, rel=1e-4)
    assert bent.sum() == pytest.approx(0.0, abs=1e-9)
    assert passed.min() == pytest.approx(0.5, rel=1e-4)
    moved, _ = window.seen(x, np.full_like(x, 1.0))
    assert x[moved.argmax()] - x[bent.argmax()] == pytest.approx(window.scratch_slant, abs=0.01)


def test_a_scratch_that_came_after_the_calibration_shows_in_its_columns(device):
    path, faced = travel(), Facets(modes=1e6)
    clear, _ = scan(device, faced, path)
    bad, _ = scan(replace(device, window=Window(scratch_rows=0.4, scratch_slant=0.0)), faced, path)
    rest = np.nanmean(bad - clear, axis=0)
    deepest = 0.4 * device.camera.row_pitch_mm / sin(THETA)
    assert np.abs(rest).max() == pytest.approx(deepest, rel=0.25)
    assert np.abs(rest[:10]).max() < 0.05 * deepest


def test_a_second_reflection_reads_in_the_shadow_of_a_step(device):
    # where the step hides the sheet's floor, the ghost beside it still lights a place that is seen
    y = np.array([-40.0, 1.0, 1.0001, 40.0])
    z = DISTANCE + tan(THETA) * y + np.array([0.0, 0.0, -1.5, -1.5])
    x = np.array([-20.0, 20.0])
    corners = np.array([[a, b, c] for b, c in zip(y, z, strict=True) for a in x])
    faces = [f for k in range(3) for f in ([2 * k, 2 * k + 2, 2 * k + 1],
                                           [2 * k + 1, 2 * k + 2, 2 * k + 3])]  # fmt: skip
    step = Solid(vertices_mm=corners, faces=np.array(faces))
    path = travel(profiles=40, pitch=0.05)
    single, _ = scan(device, Facets(), path, step)
    double, _ = scan(replace(device, window=Window(ghost=0.4, ghost_mm=0.4)), Facets(), path, step)
    assert np.isfinite(double).sum() > np.isfinite(single).sum()


def test_hot_air_has_its_amplitude_and_is_carried_by_the_wind():
    air = Air(shift_mm=0.01, wind_mm_s=50.0)
    x, t = np.linspace(-6, 6, 121), np.arange(400) / 100
    drawn = np.stack([air.shifts(x, t, np.random.default_rng(k)) for k in range(12)])
    assert drawn.std() == pytest.approx(0.01, rel=0.15)
    # one profile later the field lies 0.5 mm = 5 columns on
    np.testing.assert_allclose(drawn[:, 1:, 5:], drawn[:, :-1, :-5], atol=1e-9)


def test_hot_air_has_kolmogorovs_spectrum():
    # density of k in the plane ~ k^(-2/3) between the scales
    air = Air(shift_mm=1.0)
    low, high = 2 * pi / air.outer_mm, 2 * pi / air.inner_mm
    drawn = np.concatenate([np.abs(air.waves(np.random.default_rng(k))) for k in range(200)])
    assert drawn.max() <= high
    assert len(drawn) == 200 * MODES
    # E|k cos φ| = E k · 2/π; E k = ∫ k^(1/3) / ∫ k^(-2/3)
    mean = (3 / 4 * (high ** (4 / 3) - low ** (4 / 3))) / (3 * (high ** (1 / 3) - low ** (1 / 3)))
    assert drawn.mean() == pytest.approx(mean * 2 / pi, rel=0.02)


# --- exposures


def test_merged_exposures_read_dark_places_by_the_long_one_and_bright_ones_by_the_short(device):
    path = travel(rate=10.0)
    bright, dark = Facets(albedo=3.0, modes=1e6), Facets(albedo=0.2, modes=1e6, mirror=0.0)
    merging = replace(device, exposures=Exposures(ratio=16.0))
    for facets in (bright, dark):
        once, seen = scan(device, facets, path)
        both, merged = scan(merging, facets, path)
        if facets is dark:
            error = np.hypot(*(np.nanstd(d) / sqrt(d.size / 4) for d in (both, once)))
            assert abs(np.nanmean(both) - np.nanmean(once)) < 4 * error
            assert error < 0.003
            assert np.nanmax(merged) == pytest.approx(np.nanmax(seen) / 16, rel=0.2)
        else:
            assert np.nanmin(seen) >= 1.0  # saturated
            assert np.nanmax(merged) < 1.0
            short = replace(device, camera=replace(
                device.camera, electrons=device.camera.electrons / 16))  # fmt: skip
            wanted, _ = scan(short, facets, path)
            assert np.nanmean(both) == pytest.approx(np.nanmean(wanted), abs=3e-4)


def brightness_under(exposures, profiles=400):
    """Let the control alone run on a surface whose brightness is its exposure, unsaturated."""
    factor, before, seen = 1.0, np.nan, []
    for _ in range(profiles):
        now = 0.3 * factor
        factor, before = exposures.next_factor(factor, before), now
        seen.append(now)
    return np.array(seen)


def test_a_gentle_control_settles_and_a_hasty_one_hunts_every_six_profiles():
    # log e' = log e - g (log b of one earlier): λ² - λ + g = 0, |λ|² = g; at g = 1 λ = e^(iπ/3)
    gentle = brightness_under(Exposures(gain=0.5, target=0.6))
    assert gentle[-1] == pytest.approx(0.6, rel=1e-6)
    hasty = np.log(brightness_under(Exposures(gain=1.0, target=0.6))[-240:])
    spectrum = np.abs(np.fft.rfft(hasty - hasty.mean()))
    assert spectrum.argmax() == 240 // 6
    assert hasty.std() > 0.3


# --- belts


def test_a_sticking_belt_lags_by_its_slip_at_most_and_jumps_back():
    way = np.array([0.0, cos(THETA), sin(THETA)])
    s = np.arange(4000) * 0.02
    shift, _ = Robot(slip_mm=0.1, slip_every_mm=2.0).errors(s, s, way, np.random.default_rng(3))
    lag = -shift @ way
    assert lag.min() >= 0
    assert lag.max() == pytest.approx(0.1, rel=0.02)
    jumps = (np.diff(lag) < -0.05).sum()
    assert jumps == pytest.approx(s[-1] / 2.0, rel=0.2)


def test_an_eccentric_roller_moves_the_part_in_a_circle():
    way = np.array([0.0, 1.0, 0.0])
    s = np.arange(1000) * 0.05
    shift, _ = Robot(eccentric_mm=0.02, roller_mm=0.9).errors(s, s, way, np.random.default_rng(3))
    np.testing.assert_allclose(np.hypot(shift[:, 1], shift[:, 2]), 0.02, atol=1e-9)
    turns = np.unwrap(np.arctan2(shift[:, 1], shift[:, 2]))
    assert turns[-1] - turns[0] == pytest.approx(s[-1] / 0.9)
