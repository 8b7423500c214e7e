"""The virtual instrument against closed forms of triangulation with coherent light."""

from dataclasses import replace
from math import atan, cos, exp, hypot, pi, radians, sin, sqrt, tan

import numpy as np
import pytest

from challenge.instrument.instrument import Solid
from challenge.instrument.optical_surface import OpticalSurface
from challenge.instrument.stripes import spacings
from tests.support.optical_targets import DISTANCE, path, strip

TRIANGULATION = radians(30)
WAVELENGTH = 405e-6


def speckle_sd_mm(faultless, waist, sin_u, column_pitch, columns=120):
    camera = replace(
        faultless.camera,
        columns=columns,
        fov_rad=2 * atan(columns * column_pitch / 2 / DISTANCE),
        sin_u=sin_u,
        row_pitch_mm=0.03,
        rows=200,
    )
    device = replace(faultless, camera=camera, sheet=replace(faultless.sheet, waist_mm=waist))
    row, _, _ = device.rows_of(
        strip(DISTANCE), OpticalSurface(), path(40, 8 * waist), np.random.default_rng(0), specimen=3
    )
    return float(np.nanstd(row - np.nanmean(row, 0))) / camera.depth_to_row_slope()


def test_narrow_line_reaches_the_speckle_limit(faultless):
    # one speckle per column and a line as wide as the aperture resolves: σz = λ/(2π sin u sin θ)
    sin_u = 0.005
    waist = 0.36 * WAVELENGTH / sin_u / cos(TRIANGULATION)
    got = speckle_sd_mm(faultless, waist, sin_u, 0.006, columns=200)
    assert got == pytest.approx(WAVELENGTH / (2 * pi * sin_u * sin(TRIANGULATION)), rel=0.15)


@pytest.mark.parametrize(
    ("waist", "sin_u"), [(0.05, 0.005), (0.1, 0.005), (0.2, 0.005), (0.05, 0.008)]
)
def test_speckle_grows_with_line_width_and_falls_with_aperture(faultless, waist, sin_u):
    # second moments of a Gaussian speckle field of spread a under a line of spread s:
    # var = a s² / (2√2 √(s² + a²/2)), times the contrast left after a column's average
    got = speckle_sd_mm(faultless, waist, sin_u, 0.1)
    spread = faultless.camera.amplitude_spread_mm(WAVELENGTH) * faultless.camera.sin_u / sin_u
    line = waist * cos(TRIANGULATION)
    lag = np.linspace(-0.1, 0.1, 2001)
    overlap = (0.1 - np.abs(lag)) / 0.1**2 * np.exp(-(lag**2) / 2 / spread**2)
    contrast = sqrt(float(np.sum(overlap)) * (lag[1] - lag[0]))
    limit = sqrt(spread * line**2 / (2 * sqrt(2) * hypot(line, spread / sqrt(2))))
    # a 2-D point spread decorrelates faster than the product form: a tenth or two less
    assert got == pytest.approx(contrast * limit / sin(TRIANGULATION), rel=0.22)


def test_speckle_belongs_to_the_surface(calibrated):
    def scan(specimen, noise):
        return calibrated.scan(
            strip(DISTANCE), OpticalSurface(), path(20, 0.1), np.random.default_rng(noise),
            specimen=specimen,
        )[0]  # fmt: skip

    first, again, other = scan(1, 0), scan(1, 9), scan(2, 0)
    assert np.std(first - again) < 0.35 * np.std(first)  # only electronic noise
    assert np.std(first - other) == pytest.approx(sqrt(2) * np.std(first), rel=0.1)


@pytest.mark.parametrize("side", [1, -1])
def test_half_covered_line_is_drawn_to_the_lit_half(faultless, side):
    waist = faultless.sheet.waist_mm
    device = replace(faultless, camera=replace(faultless.camera, side=side))
    spacing, _ = spacings(device.sheet, device.camera, 0.05)
    whole, half = [], []
    for specimen in range(16):
        # the edge at every place between two sub-lines, about the line's middle on average
        edge = strip(DISTANCE, end_y=(specimen % 4 - 1.5) / 4 * spacing)
        row, _, _ = device.rows_of(
            edge, OpticalSurface(), path(21, 0.05, start_y=-1.0), np.random.default_rng(0),
            specimen=specimen,
        )  # fmt: skip
        whole.append(row[0].mean())
        half.append(row[20].mean())
    bias = (np.mean(half) - np.mean(whole)) / device.camera.depth_to_row_slope()
    assert bias == pytest.approx(-side * 0.798 * waist / tan(TRIANGULATION), rel=0.06)


# speckle scatters each column's own centre, which smears the ripple the more the wider the line
@pytest.mark.parametrize(("sigma_rows", "within"), [(0.25, 0.08), (0.3, 0.1), (0.4, 0.3)])
def test_pixel_locking(faultless, sigma_rows, within):
    pitch = 0.1
    grain = faultless.camera.amplitude_spread_mm(WAVELENGTH)
    waist = sqrt((sigma_rows * pitch) ** 2 - grain**2 / 2) / cos(TRIANGULATION)
    camera = replace(
        faultless.camera, row_pitch_mm=pitch, rows=64, smile=0.0, keystone=0.0, barrel=0.0,
        read_noise_e=0.0,
    )  # fmt: skip
    device = replace(
        faultless,
        camera=camera,
        sheet=replace(faultless.sheet, waist_mm=waist),
        finder=replace(faultless.finder, threshold=1e-6),
    )
    truth, error = [], []
    for k in range(16):
        z = DISTANCE + k / 8 / camera.depth_to_row_slope()
        row, _, _ = device.rows_of(
            strip(z), OpticalSurface(), path(12, 8 * waist), np.random.default_rng(0),
            specimen=3 + k,
        )  # fmt: skip
        truth.append(camera.row_of(np.zeros(1), np.zeros(1), np.array([z]))[0])
        error.append(np.nanmean(row) - truth[-1])
    phase = 2 * pi * np.array(truth)
    design = np.stack([np.ones(16), np.sin(phase), np.cos(phase)], 1)
    found = np.linalg.lstsq(design, np.array(error), rcond=None)[0]
    assert hypot(found[1], found[2]) == pytest.approx(
        exp(-2 * pi**2 * sigma_rows**2) / pi, rel=within
    )


@pytest.mark.parametrize("side", [1, -1])
def test_shadow_beside_a_step(calibrated, side):
    height, pitch = 2.0, 0.05
    camera = replace(calibrated.camera, side=side)
    device = replace(calibrated, camera=camera)
    x = 15.0
    upper, lower = DISTANCE - 1.0, DISTANCE + 1.0
    corners = np.array(
        [[-x, -20, upper], [x, -20, upper], [-x, 0, upper], [x, 0, upper],
         [-x, 0, lower], [x, 0, lower], [-x, 20, lower], [x, 20, lower]]
    )  # fmt: skip
    corners[:, 1] *= -side  # the wall keeps the floor from the camera's view
    faces = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5], [4, 6, 5], [5, 6, 7]])
    if side > 0:
        faces = faces[:, ::-1]
    depth, _ = device.scan(
        Solid(vertices_mm=corners, faces=faces),
        OpticalSurface(),
        path(80, pitch, start_y=-2.0),
        np.random.default_rng(0),
        specimen=1,
    )
    shadow = np.isnan(depth).mean(1).sum() * pitch
    # the line's own width lights the floor or the step's top from within about two spreads
    expected = height * camera.base_mm / lower
    assert shadow == pytest.approx(expected, abs=0.3)
    assert shadow > 0.5


@pytest.mark.parametrize("slope", [0.5, -0.5])
def test_no_bias_on_a_tilted_plane(calibrated, slope):
    flat, tilted = [], []
    where = path(30, 0.1, start_y=-1.5)
    run = slope * (-1.5 + 0.1 * np.arange(30))[:, None]
    for specimen in range(4):
        rng = np.random.default_rng(0)
        args = (OpticalSurface(), where, rng)
        flat.append(calibrated.scan(strip(DISTANCE), *args, specimen=specimen)[0] - DISTANCE)
        depth, _ = calibrated.scan(strip(DISTANCE, slope_y=slope), *args, specimen=specimen)
        tilted.append(depth - DISTANCE - run)
    bias = np.mean(tilted) - np.mean(flat)
    assert abs(bias) < 0.1 * np.std(flat)
