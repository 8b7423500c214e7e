"""The second family of instruments against closed forms, before it is used."""

from dataclasses import replace
from math import cos, pi, radians, sin, sqrt, tan

import numpy as np
import pytest

from challenge.instrument.instrument import Solid
from challenge.second.camera import Camera, find_row, taps
from challenge.second.device import Device, Travel, rectified
from challenge.second.facets import Facets
from challenge.second.firmware import Firmware
from challenge.second.robot import Robot, Warmth
from challenge.second.slit import Slit

THETA = radians(27)
DISTANCE = 120.0


@pytest.fixture(scope="module")
def device():
    camera = Camera(
        theta_rad=THETA, side=1, rows=192, row_pitch_mm=0.035, columns=120, x_fov_mm=12.0,
        bend_rows=1.5, shear_rows=0.8, barrel=0.01,
    )  # fmt: skip
    bare = Device(
        slit=Slit(width_mm=0.07, blur_mm=0.03, coherence=0.4), camera=camera,
        firmware=Firmware(step_mm=2.5e-4),
    )  # fmt: skip
    return bare.calibrated(np.random.default_rng(0))


def travel(profiles=40, pitch=0.1, y_mm=0.0):
    start = np.eye(4)
    start[1, 3] = y_mm
    return Travel(start=start, profiles=profiles, pitch_mm=pitch, rate_hz=100.0, start_s=0.0)


def sheet(z_of_y, y=(-60.0, 60.0)):
    """Open strip z(y) facing the sensor, through the given y."""
    y = np.array(y)
    z = np.array([z_of_y(v) for v in y])
    x = np.array([-40.0, 40.0])
    vertices = np.array([[a, b, c] for b, c in zip(y, z, strict=True) for a in x])
    faces = []
    for k in range(len(y) - 1):
        a = 2 * k
        faces += [[a, a + 2, a + 1], [a + 1, a + 2, a + 3]]
    return Solid(vertices_mm=vertices, faces=np.array(faces))


def expected(device, path, z_of_y):
    """Depth on the sheet of light of each profile, for a plane z(y) = z0 + p y."""
    out = []
    for at in path.travel_mm:
        origin = at * device.way
        out.append(z_of_y(path.start[1, 3] + origin[1]) - origin[2])
    return np.array(out)


# --- light


def test_a_coherent_slit_is_a_quarter_at_its_edge_and_an_incoherent_one_a_half():
    wide = Slit(width_mm=4.0, blur_mm=0.01, coherence=1.0)
    assert float(wide.irradiance(np.array(2.0))) == pytest.approx(0.25, abs=0.01)
    wide = replace(wide, coherence=0.0)
    assert float(wide.irradiance(np.array(2.0))) == pytest.approx(0.5, abs=0.01)


def test_coherent_light_rings_and_incoherent_light_does_not():
    eta = np.linspace(0, 0.2, 4000)
    ringing = Slit(width_mm=0.2, blur_mm=0.02, coherence=1.0).irradiance(eta)
    smooth = Slit(width_mm=0.2, blur_mm=0.02, coherence=0.0).irradiance(eta)
    assert ringing.max() > 1.1
    assert smooth.max() <= 1.0 + 1e-9
    outside = ringing[eta > 0.115]
    assert (np.diff(np.sign(np.diff(outside))) < 0).sum() >= 2  # side lobes


@pytest.mark.parametrize("coherence", [0.0, 1.0])
def test_all_of_the_light_goes_somewhere(coherence):
    # Parseval: a band-limited image keeps nearly all of a wide slit's energy
    eta = np.linspace(-3, 3, 200001)
    light = Slit(width_mm=0.5, blur_mm=0.02, coherence=coherence).irradiance(eta)
    assert light.sum() * (eta[1] - eta[0]) == pytest.approx(0.5, rel=0.03)


# --- surface


def test_facets_cover_the_surface_once():
    # ∫ D(h) (h·n) dω = 1 for any slopes
    facets = Facets(slope_along=0.2, slope_across=0.5)
    t, p = np.meshgrid(
        (np.arange(800) + 0.5) / 800 * pi / 2, (np.arange(400) + 0.5) / 400 * 2 * pi
    )
    half = facets.density(np.cos(t), np.sin(t) * np.cos(p), np.sin(t) * np.sin(p))
    total = (half * np.cos(t) * np.sin(t)).sum() * (pi / 2 / 800) * (2 * pi / 400)
    assert total == pytest.approx(1.0, rel=1e-3)


def test_a_lay_is_bright_across_itself():
    facets = Facets(albedo=0.0, mirror=1.0, slope_along=0.05, slope_across=0.5)
    normal, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, -1.0])
    camera = np.array([0.0, sin(THETA), -cos(THETA)])
    _, along = facets.towards(normal, np.array([0.0, 1.0, 0.0]), up, camera)
    _, across = facets.towards(normal, np.array([1.0, 0.0, 0.0]), up, camera)
    assert across > 10 * along


def test_speckle_contrast_is_one_over_the_root_of_the_modes():
    drawn = Facets(modes=9.0).speckle((400, 400), np.random.default_rng(0))
    assert drawn.mean() == pytest.approx(1.0, abs=0.01)
    assert drawn.std() == pytest.approx(1 / 3, abs=0.01)


# --- geometry


def test_displaced_light_reads_deeper_by_its_cotangent(device):
    camera = replace(device.camera, bend_rows=0.0, shear_rows=0.0)
    for side in (1, -1):
        seen = replace(camera, side=side)
        shifted = seen.row_of(0.0, 0.05, 0.0)
        deeper = seen.row_of(0.0, 0.0, side * 0.05 / tan(THETA))
        assert shifted == pytest.approx(deeper)


def test_the_commanded_travel_moves_the_image_of_the_part_by_itself_only(device):
    # an upright camera sees a horizontal shift as a shift, never as a scale or a height
    part = np.array([0.3, 0.2, 1.0])
    moved = part - 0.7 * device.way
    camera = replace(device.camera, bend_rows=0.0, shear_rows=0.0)
    before, after = (camera.row_of(*p) for p in (part, moved))
    assert (before - after) * camera.row_pitch_mm == pytest.approx(0.7)
    assert device.way @ device.to_camera == pytest.approx(0.0)


@pytest.mark.parametrize("slope", [-0.6, -0.3, 0.0, 0.3, 0.5])
def test_a_tilted_plane_is_read_without_bias(device, slope):
    level = tan(THETA)  # a plane along the travel stays in range

    def plane(y):
        return DISTANCE + (level + slope) * (y - 1.8)

    path = travel(pitch=0.1)
    got, _ = device.scan(sheet(plane), Facets(), path, np.random.default_rng(1), specimen=5)
    rest = got - expected(device, path, plane)[:, None]
    error = np.nanstd(rest) / sqrt(np.isfinite(rest).sum() / 6)  # six correlated readings
    assert np.isfinite(rest).mean() > 0.98
    # the calibration's own share: fifteen plates, read with speckle
    assert abs(np.nanmean(rest)) < 4 * error + 5e-4


def test_the_end_columns_of_a_slope_along_the_line_read_like_all_others(device):
    # light beyond the last reading reaches it through the lens as light from inside does
    path, slope = travel(pitch=0.1), 0.5
    x, y = np.meshgrid([-40.0, 40.0], [-60.0, 60.0])
    level = DISTANCE + tan(THETA) * (y - 1.8)
    corners = np.stack([x, y, level + slope * x], -1).reshape(-1, 3)
    plane = Solid(vertices_mm=corners, faces=np.array([[0, 2, 1], [1, 2, 3]]))
    got, _ = device.scan(plane, Facets(), path, np.random.default_rng(1), specimen=5)
    truth = expected(device, path, lambda y: DISTANCE + tan(THETA) * (y - 1.8))
    rest = got - truth[:, None] - slope * device.camera.even_mm
    columns = np.nanmean(rest, axis=0)
    usual = np.nanstd(columns[2:-2])
    assert np.abs(columns[[0, 1, -2, -1]] - np.nanmean(columns)).max() < 4 * usual


def test_a_shadow_is_as_long_as_the_tangent_says(device):
    # a wall of height h along the sheet hides the floor behind it over h tan θ
    high = 2.0

    def floor(y):
        return DISTANCE + tan(THETA) * y

    wall = sheet(floor, (-60.0, 2.0))
    back = sheet(lambda y: floor(y) - high, (2.0, 60.0))
    both = Solid(
        vertices_mm=np.concatenate([wall.vertices_mm, back.vertices_mm]),
        faces=np.concatenate([wall.faces, back.faces + len(wall.vertices_mm)]),
    )
    path = travel(profiles=60, pitch=0.05)
    got, _ = device.scan(both, Facets(), path, np.random.default_rng(1), specimen=5)
    reads_floor = np.abs(got - expected(device, path, floor)[:, None]) < 0.3
    # along the sheet's y: the floor falls by tan θ a mm, so that the sight line meets it at
    # h tan θ / (1 + tan² θ); half a line's width more or less is lit
    length = high * tan(THETA) / (1 + tan(THETA) ** 2)
    hidden = 2.0 - path.travel_mm[reads_floor[:, 60]].max() * cos(THETA)
    assert hidden == pytest.approx(length, abs=0.5 * device.slit.width_mm + 0.05)


# --- noise


def test_noise_falls_with_the_root_of_the_modes(device):
    quiet = replace(
        device, camera=replace(device.camera, read_noise_e=0.5, electrons=1e7, full_well=1e7)
    )

    def noise(modes):
        flat = sheet(lambda y: DISTANCE + tan(THETA) * y)
        path = travel(profiles=80)
        got, _ = quiet.scan(
            flat, Facets(modes=modes), path, np.random.default_rng(1), specimen=7
        )
        rest = got - np.nanmean(got, axis=0)
        return float(np.nanstd(rest[:, 20:100]))

    assert noise(10.0) / noise(40.0) == pytest.approx(2.0, rel=0.15)


def test_speckle_belongs_to_the_part(device):
    flat, path = sheet(lambda y: DISTANCE + tan(THETA) * y), travel()

    def scan(specimen, noise):
        return device.scan(
            flat, Facets(), path, np.random.default_rng(noise), specimen=specimen
        )[0]

    def alike(a, b):
        a, b = a - np.nanmean(a, axis=0), b - np.nanmean(b, axis=0)
        both = np.isfinite(a) & np.isfinite(b)
        return np.corrcoef(a[both], b[both])[0, 1]

    assert alike(scan(3, 1), scan(3, 2)) > 0.8
    assert abs(alike(scan(3, 1), scan(4, 2))) < 0.1


# --- chip, firmware, path


@pytest.mark.parametrize("kind", [0, 1, 2, 3])
def test_finders_find_a_single_peak_and_differ_on_two(kind):
    r = np.arange(64.0)
    one = 900 * np.exp(-0.5 * ((r - 30.3) / 1.1) ** 2)
    assert find_row(one, kind, 20.0) == pytest.approx(30.3, abs=0.05)
    two = one + 500 * np.exp(-0.5 * ((r - 12.0) / 1.1) ** 2)
    two = two + 300 * np.exp(-0.5 * ((r - 50.0) / 1.1) ** 2)
    assert find_row(two, kind, 20.0) == pytest.approx((30.3, 12.0, 50.0, 30.3)[kind], abs=0.05)


@pytest.mark.parametrize("kind", [0, 3])
@pytest.mark.parametrize("slope", [-0.8, 0.0, 0.5])
def test_a_good_instruments_finder_hardly_locks_to_the_rows(kind, slope):
    # the line of an ordinary instrument on a slope, moved over a row
    eta = np.arange(-0.2, 0.2, 0.003)
    light = Slit(width_mm=0.07, blur_mm=0.025, coherence=0.4).irradiance(eta)
    off = []
    for part in np.linspace(0, 1, 21):
        row = 20.3 + part + eta * (cos(THETA) + slope * sin(THETA)) / 0.035
        sharp = np.zeros(41)
        np.add.at(sharp, row.astype(int), light * (1 - row % 1))
        np.add.at(sharp, row.astype(int) + 1, light * (row % 1))
        level = 9000 * np.convolve(sharp, taps(1.1), "same") / sharp.sum()
        off.append(find_row(level, kind, 20.0) - 20.3 - part)
    assert np.ptp(off) / 2 < 0.005  # of a row; a parabola through three pixels: up to 0.07


def test_a_matched_gaussian_is_exact_on_a_gaussian():
    r = np.arange(64.0)
    for at in (30.0, 30.21, 30.5, 30.77):
        level = 5000 * np.exp(-0.5 * ((r - at) / 1.3) ** 2)
        assert find_row(level, 3, 20.0) == pytest.approx(at, abs=2e-4)


def test_a_median_of_three_leaves_the_variance_that_theory_says():
    # order statistics of three normal numbers: 0.4487
    noise = DISTANCE + 0.01 * np.random.default_rng(0).standard_normal((300, 300))
    filtered = Firmware(median=3, step_mm=2e-6).deliver(noise, DISTANCE - 0.06)
    assert filtered.var() / noise.var() == pytest.approx(0.4487, abs=0.01)


def test_counts_round_evenly_and_nothing_is_the_sentinel():
    z = np.random.default_rng(0).uniform(100, 110, (200, 200))
    z[0, 0] = np.nan
    got = Firmware(step_mm=0.01).deliver(z, 99.0)
    assert np.isnan(got[0, 0])
    assert np.isnan(got).sum() == 1
    assert np.nanstd(got - z) == pytest.approx(0.01 / sqrt(12), rel=0.02)


def test_short_gaps_are_filled_and_long_ones_are_not():
    row = np.arange(100.0, 120.0)[None]
    row[0, 4:6], row[0, 10:14], row[0, 19:] = np.nan, np.nan, np.nan
    got = Firmware(gap=2, step_mm=1e-3).deliver(row, 99.0)
    np.testing.assert_allclose(got[0, 4:6], [104, 105], atol=1e-3)
    assert np.isnan(got[0, 10:14]).all()
    assert np.isnan(got[0, 19])


def test_rectified_profiles_are_linear_where_the_surface_is(device):
    camera = device.camera
    values = 3.0 + 0.2 * camera.columns_mm[None]
    np.testing.assert_allclose(rectified(camera, values)[0], 3.0 + 0.2 * camera.even_mm, atol=1e-9)


def test_warmth_acts_by_the_angle(device):
    # rows v = z sin θ read by a cold calibration: z' = z sin(θ + δ) / sin θ, so z δ cot θ
    warm = replace(device, warmth=Warmth(turn_rad=2e-3, constant_s=1e-6))
    path, got = travel(profiles=30), {}
    for high in (-4.0, 4.0):
        flat = sheet(lambda y, h=high: DISTANCE + h + tan(THETA) * y)
        cold_z, warm_z = (
            d.scan(flat, Facets(), replace(path, start_s=10.0), np.random.default_rng(1),
                   specimen=5)[0]
            for d in (device, warm)
        )  # fmt: skip
        got[high] = float(np.nanmean(warm_z - cold_z))
    assert got[4.0] - got[-4.0] == pytest.approx(8.0 * 2e-3 / tan(THETA), rel=0.05)


def test_a_shaking_frame_moves_whole_profiles_and_a_slip_nothing_along_the_travel(device):
    flat, path = sheet(lambda y: DISTANCE + tan(THETA) * y), travel(profiles=40)

    def scan(robot):
        return replace(device, robot=robot).scan(
            flat, Facets(modes=1e6), path, np.random.default_rng(1), specimen=5
        )[0]

    still = scan(Robot())
    shaken = scan(Robot(shake_mm=0.02, shake_hz=11.0)) - still
    rows = np.nanmean(shaken, axis=1)
    assert rows.std() == pytest.approx(0.02 / sqrt(2), rel=0.15)
    # what columns differ by is the chip's locking, another in each row phase
    assert np.nanstd(shaken - rows[:, None]) < 0.4 * rows.std()
    # the plate is level along the travel: a slip shows it another place of the same height
    slipped = np.nanmean(scan(Robot(ripple_mm=0.02)) - still, axis=1)
    assert slipped.std() < 0.002 * 0.02


@pytest.mark.parametrize("slope", [-0.4, 0.3])
def test_a_slip_reads_its_length_times_the_slope_along_the_travel(device, slope):
    way = device.way

    def plane(y):  # rises by `slope` for each mm of travel above a plane level along it
        return DISTANCE + (way[2] / way[1]) * y + slope * y / way[1]

    path = travel(profiles=40)
    steady, slipped = (
        replace(device, robot=robot).scan(
            sheet(plane), Facets(modes=1e6), path, np.random.default_rng(1), specimen=5
        )[0]
        for robot in (Robot(), Robot(ripple_mm=0.02))
    )
    moved = np.nanmean(slipped - steady, axis=1)
    assert moved.std() == pytest.approx(0.02 / sqrt(2) * abs(slope), rel=0.1)


def test_speckle_is_the_part_s_and_not_the_grid_s(device):
    # two scans from places a profile apart share no column's noise; two from one place share all
    def noise(y_mm, seed):
        def plane(y):
            return DISTANCE + tan(THETA) * (y - 1.8)

        path = travel(pitch=0.3, y_mm=y_mm)
        rng = np.random.default_rng(seed)
        got, _ = device.scan(sheet(plane), Facets(), path, rng, specimen=5)
        rest = got - expected(device, path, plane)[:, None]
        return (rest - np.nanmean(rest)).ravel()

    here, again, beside = noise(0.0, 1), noise(0.0, 2), noise(0.05, 3)
    assert np.corrcoef(here, again)[0, 1] > 0.5
    assert abs(np.corrcoef(here, beside)[0, 1]) < 4 / sqrt(here.size / 6)


def test_interpolation_reaches_as_far_as_the_barrel_makes_it(device):
    # shares f and 1 - f have the variance f (1 - f): none on even columns, 1/6 where f is any
    pitch = device.camera.x_fov_mm / (device.camera.columns - 1)
    lens = pitch * device.camera.blur_columns
    assert replace(device.camera, barrel=0.0).footprint_mm == pytest.approx(lens, rel=1e-6)
    moved = replace(device.camera, barrel=0.3)
    assert moved.footprint_mm == pytest.approx(float(np.hypot(lens, pitch / sqrt(6))), rel=0.02)
