"""Ray casting, peak finders, calibration, motion and second bounce of the virtual instrument."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
import trimesh

from challenge.cases.devices import draw_instrument, draw_scans
from challenge.cases.parts import SHAPES, solid_of
from challenge.cases.switches import World
from challenge.cases.truth import followed
from challenge.instrument.frames import Faults
from challenge.instrument.instrument import Solid
from challenge.instrument.motion import Motion
from challenge.instrument.optical_surface import OpticalSurface
from challenge.instrument.peaks import KINDS, locate
from challenge.instrument.rays import nearest, plant
from challenge.instrument.sheet import LaserSheet
from tests.support.optical_targets import DISTANCE, path, strip


def test_rays_meet_a_sphere_within_its_sagitta():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=5.0)
    tree = plant(np.asarray(ball.vertices), np.asarray(ball.faces))
    rng = np.random.default_rng(0)
    for x, y in rng.uniform(-3, 3, (200, 2)):
        far, which = nearest(tree, (x, y, -50.0), (0.0, 0.0, 1.0), 0.0, 1e9, False)
        assert which >= 0
        z = -50.0 + far
        assert 0 <= 5.0 - np.sqrt(x * x + y * y + z * z) < 0.01
        assert tree.normal[which, 2] < 0


def test_rays_equal_brute_force():
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(60, 1, 3)) * 3 + rng.normal(size=(60, 3, 3))
    tree = plant(corners.reshape(-1, 3), np.arange(180).reshape(-1, 3))
    soup = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(180).reshape(-1, 3), process=False)
    for _ in range(100):
        o, d = rng.normal(size=3) * 5, rng.normal(size=3)
        t, _ = nearest(tree, tuple(o), tuple(d), 0.0, 1e9, False)
        best = np.inf
        for a, b, c in soup.triangles:
            m = np.stack([b - a, c - a, -d], 1)
            u, v, s = np.linalg.solve(m, o - a)
            if u >= 0 and v >= 0 and u + v <= 1 and s > 0:
                best = min(best, s)
        assert t == pytest.approx(best) or (np.isinf(t) and np.isinf(best))


@pytest.mark.parametrize("kind", KINDS)
def test_peak_finders_find_a_smooth_line(kind):
    rows = np.arange(40.0)
    for centre in (18.0, 18.3, 18.77):
        level = np.floor(900 * np.exp(-0.5 * ((rows - centre) / 1.4) ** 2) + 0.5)
        row, peak = locate(level, 40, KINDS.index(kind), 20.0)
        assert row == pytest.approx(centre, abs=0.06)
        assert peak == level.max()


@pytest.mark.parametrize("kind", KINDS)
def test_no_line_no_row(kind):
    row, _ = locate(np.full(40, 3.0), 40, KINDS.index(kind), 20.0)
    assert np.isnan(row)


@pytest.mark.parametrize("centre", [1.0, 38.2])
def test_line_that_runs_off_the_chip_has_no_two_crossings(centre):
    level = 900 * np.exp(-0.5 * ((np.arange(40.0) - centre) / 1.4) ** 2)
    row, peak = locate(level, 40, KINDS.index("threshold"), 20.0)
    assert np.isnan(row)
    assert peak == level.max()


def test_sheet_widens_by_root_two_at_the_rayleigh_range():
    sheet = LaserSheet(waist_mm=0.04, waist_z_mm=100.0, m_squared=1.0)
    assert sheet.rayleigh_mm == pytest.approx(pi * 0.08**2 / 405e-6)
    assert sheet.sigma_mm(100.0 + sheet.rayleigh_mm) == pytest.approx(0.04 * np.sqrt(2))


def test_calibration_undoes_the_lens(calibrated):
    angle = calibrated.camera.angles_rad()
    for z in (146.0, 150.0, 154.0):
        row = calibrated.camera.row_of(z * np.tan(angle), np.zeros_like(angle), np.full(160, z))
        error = calibrated.calibration.depth_mm(row[None])[0] - z
        assert np.abs(error).max() < 0.003
    assert np.ptp(calibrated.camera.row_of(150 * np.tan(angle), 0 * angle, 0 * angle + 150)) > 1


def test_poor_calibration_leaves_a_bow(instrument):
    plan = replace(instrument.plan, column_degree=1)
    camera = replace(instrument.camera, smile=3.0)
    device = replace(instrument, plan=plan, camera=camera).calibrated(np.random.default_rng(5))
    depth, _ = device.scan(
        strip(DISTANCE), OpticalSurface(), path(30, 0.4), np.random.default_rng(0), specimen=1
    )
    bend = np.polyfit(np.linspace(-1, 1, 160), depth.mean(0), 2)[0]
    assert bend == pytest.approx(3.0 / camera.depth_to_row_slope(), rel=0.15)


def test_stretched_gauge_scales_the_range(instrument):
    plan = replace(instrument.plan, gauge_stretch=2e-3)
    device = replace(instrument, plan=plan).calibrated(np.random.default_rng(5))
    read = []
    for z in (147.0, 153.0):
        depth, _ = device.scan(
            strip(z), OpticalSurface(), path(30, 0.4), np.random.default_rng(0), specimen=1
        )
        read.append(depth.mean())
    assert (read[1] - read[0]) / 6.0 - 1 == pytest.approx(-2e-3, rel=0.25)


def test_vibration_moves_whole_rows(calibrated):
    motion = Motion(shake_mm=0.03, shake_hz=13.0)
    device = replace(calibrated, motion=motion)
    depth, _ = device.scan(
        strip(DISTANCE), OpticalSurface(), path(100, 0.1), np.random.default_rng(0), specimen=1
    )
    spectrum = np.abs(np.fft.rfft(depth.mean(1) - depth.mean()))
    assert np.argmax(spectrum) == 13
    assert 2 * spectrum[13] / 100 == pytest.approx(0.03, rel=0.05)


def test_mounting_roll_tilts_a_plate(calibrated):
    device = replace(calibrated, motion=Motion(roll_rad=2e-3))
    depth, _ = device.scan(
        strip(DISTANCE), OpticalSurface(), path(20, 0.4), np.random.default_rng(0), specimen=1
    )
    x = DISTANCE * np.tan(calibrated.camera.angles_rad())
    # rotating the sensor by +roll about its y turns the plate by -roll under it: z rises with x
    assert np.polyfit(x, depth.mean(0), 1)[0] == pytest.approx(2e-3, rel=0.05)


def test_second_bounce_lands_beside_the_line_in_a_groove(calibrated):
    # two walls at 45 degrees, groove along x: light of one wall lights the other
    x = 15.0
    deep = 152.0
    corners = np.array(
        [[-x, -4, deep - 4], [x, -4, deep - 4], [-x, 0, deep], [x, 0, deep],
         [-x, 4, deep - 4], [x, 4, deep - 4]]
    )  # fmt: skip
    groove = Solid(
        vertices_mm=corners, faces=np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]])
    )
    where = path(60, 0.1, start_y=-3.0)
    device = replace(calibrated, finder=replace(calibrated.finder, kind="gravity_all"))
    truth = deep - np.abs(-3.0 + 0.1 * np.arange(60))[:, None]
    error = []
    for mirror in (0.0, 0.5):
        depth, _ = device.scan(
            groove,
            OpticalSurface(mirror=mirror, facet_slope=0.1),
            where,
            np.random.default_rng(0),
            specimen=1,
        )
        error.append(np.nanmean(np.abs(depth - truth)))
    assert error[1] > 3 * error[0]


def test_stripes_of_albedo_shift_the_line_at_their_edges(calibrated):
    surface = OpticalSurface(
        albedo_ratio=0.2, albedo_period_mm=2.0, albedo_angle_rad=pi / 2, albedo_share=0.5
    )
    where = path(40, 0.05)
    total = []
    for specimen in range(6):
        depth, _ = calibrated.scan(
            strip(DISTANCE), surface, where, np.random.default_rng(0), specimen=specimen
        )
        total.append(depth.mean(1) - DISTANCE)
    mean = np.mean(total, 0)
    # dark below y = 1, bright above: the line is drawn towards +y, deeper for a camera at +y;
    # κ s √(2/π) (1-r)/(1+r) cot θ
    expected = 0.05 * np.sqrt(2 / pi) * 0.8 / 1.2 * np.sqrt(3)
    assert mean[18:23].max() == pytest.approx(expected, rel=0.25)


def test_faults_reach_the_file(calibrated):
    def read(device):
        depth, _ = device.scan(
            strip(DISTANCE), OpticalSurface(), path(40, 0.4), np.random.default_rng(0), specimen=1
        )
        return depth

    clean = read(calibrated)
    depth = read(replace(calibrated, faults=Faults(spikes=0.02)))
    assert 0.002 < np.mean(~(np.abs(depth - DISTANCE) < 0.2)) < 0.025
    depth = read(replace(calibrated, faults=Faults(lost_share=0.1)))
    assert np.isnan(depth).mean() == pytest.approx(0.1, abs=0.03)
    assert not np.isnan(clean).any()


def test_fixed_rng_fixed_recording(calibrated):
    def scan():
        return calibrated.scan(
            strip(DISTANCE), OpticalSurface(), path(5, 0.4), np.random.default_rng(7), specimen=1
        )

    for one, two in zip(scan(), scan(), strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_longer_exposure_is_followed_by_the_way_to_its_middle():
    device = draw_instrument(np.random.default_rng(1))
    scans = draw_scans(np.random.default_rng(2), device)
    block = solid_of(SHAPES["terraces"](np.random.default_rng(3)))
    world = World(
        device=device, surface=OpticalSurface(), solid=block, nominal=block, scans=scans, seed=0
    )  # fmt: skip
    path = scans.paths[1]
    exposure = device.sheet.exposure_s + 4.0 / path.rate_hz
    scans_on = followed(world, 1, exposure).scans
    as_seen = np.linalg.inv(scans.misplaced[1] @ path.start) @ scans_on.misplaced[1] @ path.start
    expected = np.eye(4)
    expected[1, 3] = 2.0 * path.direction * path.pitch_mm  # half of four profiles
    np.testing.assert_allclose(as_seen, expected, atol=1e-9)
    assert scans_on.misplaced[0] is scans.misplaced[0]
    assert followed(world, 1, device.sheet.exposure_s) is world
