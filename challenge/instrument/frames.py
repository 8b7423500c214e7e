"""Camera frames: coherent image of the lit scatterers, exposure, chip noise, peak rows."""

from dataclasses import dataclass
from math import erf, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.camera import Camera
from challenge.instrument.peaks import KINDS, PeakFinder, locate
from challenge.instrument.sheet import LaserSheet
from challenge.instrument.stripes import Stripes

_TAP_BINS = 64
_FASTMATH = {"contract", "reassoc", "arcp", "nsz"}  # all but what NaN and infinity need


@dataclass(frozen=True, kw_only=True, slots=True)
class Faults:
    """What can go wrong between chip and file.

    Attributes
    ----------
    spikes
        Share of columns in a frame that a stray glint or discharge hits at some row.
    lost_share
        Share of points lost on the way (transmission, dust in the beam), in short runs.
    stall_share
        Share of frames for which the buffer delivers the frame before.
    window_dip, window_at, window_width
        A dirty window: share of light it takes at its centre, where along the line
        (-1 to 1), and its half width (same unit).
    """

    spikes: float = 0.0
    lost_share: float = 0.0
    stall_share: float = 0.0
    window_dip: float = 0.0
    window_at: float = 0.0
    window_width: float = 0.2


@njit(cache=True)
def _spill(
    level: NDArray[np.float64], spilt: NDArray[np.float64], full_well: float, bloom: float
) -> None:
    """Clip full pixels; half of what is too much runs up the column, half down."""
    rows = level.size
    for r in range(rows):
        spilt[r] = max(level[r] - full_well, 0.0) * bloom * 0.5
        level[r] = min(level[r], full_well)
    for turn in range(2):
        carry = 0.0
        for k in range(rows):
            r = k if turn == 0 else rows - 1 - k
            taken = min(carry, full_well - level[r])
            level[r] += taken
            carry += spilt[r] - taken


class _Scatterers(NamedTuple):
    """The lit surface: (G,) lines of (G, M) points, mm; power and phase of each."""

    y: NDArray[np.float64]
    x: NDArray[np.float64]
    z: NDArray[np.float64]
    power: NDArray[np.float32]
    cosine: NDArray[np.float32]
    sine: NDArray[np.float32]
    below: NDArray[np.float32]
    layers: NDArray[np.float64]  # mm below the surface that the light turns at


class _Sheet(NamedTuple):
    """The laser sheet, mm, and the share of its power that one scatterer has."""

    waist: float
    waist_z: float
    rayleigh: float
    share: float


class _Lens(NamedTuple):
    """Where the camera images a point: `Camera.row_of`, and columns by angle."""

    columns: int
    rows: int
    step_rad: float
    half_fov: float
    focal: float
    tan_0: float
    side: float
    base: float
    smile: float
    keystone: float
    barrel: float


class _Grid(NamedTuple):
    """The fine grid on which amplitudes add: points a pixel, and a point's image on it."""

    fine_c: int
    fine_r: int
    taps_c: NDArray[np.float32]
    taps_r: NDArray[np.float32]


class _Amplitude(NamedTuple):
    """Amplitude on the fine grid, and the rows that are lit in each of its columns."""

    real: NDArray[np.float32]
    imag: NDArray[np.float32]
    low: NDArray[np.int64]
    high: NDArray[np.int64]


class _Chip(NamedTuple):
    """From light to counts, and from counts to the line."""

    electrons: NDArray[np.float64]  # (columns,): of the whole line on the white plate
    ambient: NDArray[np.float64]  # (profiles, rows)
    full_well: float
    read_noise: float
    scale: float
    bloom: float
    kind: int
    threshold: float
    spikes: float
    quiet: bool  # no noise reaches the threshold: none is drawn for dark pixels


@njit(cache=True, fastmath=_FASTMATH)
def _add_layer(
    image: _Amplitude,
    lit: _Scatterers,
    layer: int,
    at_mm: NDArray[np.float64],
    sheet: _Sheet,
    lens: _Lens,
    grid: _Grid,
    images: int,
) -> None:
    """Add the amplitudes of one layer's scatterers, the sensor at (3,), one of so many images."""
    n_r = lens.rows * grid.fine_r
    reach_c, reach_r = grid.taps_c.shape[1], grid.taps_r.shape[1]
    deep = lit.below.shape[0] > 1
    off_x, off_y, off_z = at_mm
    for g in range(lit.y.size):
        eta = lit.y[g] - off_y
        if abs(eta) > 12 * sheet.waist:
            continue
        for m in range(lit.x.shape[1]):
            strength = lit.power[g, m]
            if strength <= 0:
                continue
            depth = lit.z[g, m] - off_z
            wide = 1 + ((depth - sheet.waist_z) / sheet.rayleigh) ** 2
            q = eta * eta / (sheet.waist * sheet.waist * wide)
            if q > 12.25:
                continue
            amplitude = sqrt(
                strength * sheet.share * np.exp(-0.5 * q) / sqrt(wide) / lit.layers.size / images
            )
            px, py = lit.x[g, m] - off_x, eta
            if deep:
                px += lit.layers[layer] * lit.below[g, m, 0]
                py += lit.layers[layer] * lit.below[g, m, 1]
                depth += lit.layers[layer] * lit.below[g, m, 2]
            row = lens.focal * (lens.tan_0 + (lens.side * py - lens.base) / depth)
            bearing = np.arctan(px / depth)
            u, v = bearing / lens.half_fov, 2 * row / lens.rows
            row += lens.smile * u * u + lens.keystone * u * v + lens.barrel * v * (u * u + v * v)
            # position of the point image on the fine grid, pixel centres integer
            fr = ((lens.rows - 1) / 2 + row + 0.5) * grid.fine_r - 0.5
            fc = (bearing / lens.step_rad + (lens.columns - 1) / 2 + 0.5) * grid.fine_c
            fc = fc - 0.5 + reach_c
            r0, c0 = int(np.floor(fr)), int(np.floor(fc))
            br = int((fr - r0) * _TAP_BINS)
            bc = int((fc - c0) * _TAP_BINS)
            r0 -= reach_r // 2 - 1
            c0 -= reach_c // 2 - 1
            if r0 < 0 or r0 + reach_r >= n_r or c0 < 0 or c0 + reach_c >= image.real.shape[0]:
                continue
            other = (m + 37 * layer) % lit.x.shape[1]
            re = np.float32(amplitude * lit.cosine[g, other])
            im = np.float32(amplitude * lit.sine[g, other])
            tap = grid.taps_r[br]
            for c in range(reach_c):
                a, b = re * grid.taps_c[bc, c], im * grid.taps_c[bc, c]
                col = c0 + c
                in_real = image.real[col, r0 : r0 + reach_r]
                in_imag = image.imag[col, r0 : r0 + reach_r]
                for r in range(reach_r):
                    in_real[r] += a * tap[r]
                    in_imag[r] += b * tap[r]
                image.low[col] = min(image.low[col], r0)
                image.high[col] = max(image.high[col], r0 + reach_r)


@njit(cache=True, fastmath=_FASTMATH)
def _collect(image: _Amplitude, grid: _Grid, light: NDArray[np.float64]) -> None:
    """Add the image's intensity to the chip's pixels (columns, rows), and clear the image."""
    reach_c = grid.taps_c.shape[1]
    for col in range(image.real.shape[0]):
        c = (col - reach_c) // grid.fine_c
        for r in range(image.low[col], image.high[col]):
            if 0 <= c < light.shape[0]:
                light[c, r // grid.fine_r] += (
                    image.real[col, r] * image.real[col, r]
                    + image.imag[col, r] * image.imag[col, r]
                )
            image.real[col, r] = 0.0
            image.imag[col, r] = 0.0
        image.low[col] = image.real.shape[1]
        image.high[col] = -1


@njit(cache=True, fastmath=_FASTMATH)
def _add_glow(glow: NDArray[np.float32], light: NDArray[np.float64]) -> None:
    """Add second bounces (k, 3): column, row, power."""
    columns, rows = light.shape
    for k in range(glow.shape[0]):
        if glow[k, 2] <= 0:
            continue
        c0, r0 = int(round(glow[k, 0])), int(round(glow[k, 1]))
        for c in range(c0 - 1, c0 + 2):
            for r in range(r0 - 3, r0 + 4):
                if 0 <= c < columns and 0 <= r < rows:
                    dc, dr = c - glow[k, 0], r - glow[k, 1]
                    light[c, r] += glow[k, 2] * np.exp(-0.5 * (dc * dc + dr * dr)) / 6.2832


@njit(cache=True, fastmath=_FASTMATH)
def _read_out(
    light: NDArray[np.float64],
    chip: _Chip,
    profile: int,
    column: int,
    level: NDArray[np.float64],
    spilt: NDArray[np.float64],
    rng: np.random.Generator,
) -> None:
    """Fill (rows,) counts of one column: glints, shot and read noise, blooming, conversion."""
    rows = level.size
    stray_row, stray = -1, 0.0
    if chip.spikes > 0 and rng.random() < chip.spikes:
        stray_row = int(rng.random() * rows)
        stray = chip.full_well * (0.3 + 0.9 * rng.random())
    for r in range(rows):
        mean = light[column, r] * chip.electrons[column]
        if r == stray_row:
            mean += stray
        level[r] = chip.ambient[profile, r]
        if mean >= 1.0 or not chip.quiet:
            mean += level[r]
            noise = sqrt(mean + chip.read_noise * chip.read_noise)
            level[r] = mean + noise * rng.standard_normal()
    _spill(level, spilt, chip.full_well, chip.bloom)
    for r in range(rows):
        level[r] = np.floor(level[r] * chip.scale + 0.5)


@njit(cache=True, fastmath=_FASTMATH)
def _frames(
    lit: _Scatterers,
    sheet: _Sheet,
    lens: _Lens,
    grid: _Grid,
    chip: _Chip,
    where: NDArray[np.float64],  # (profiles, sub-exposures, 3): true position of the sensor
    glow: NDArray[np.float32],  # (profiles, k, 3): column, row, power of second bounces
    rng: np.random.Generator,
    keep: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Render, expose and read out every profile; see `expose` for the physics."""
    profiles, images = where.shape[0], where.shape[1]
    n_c = lens.columns * grid.fine_c + 2 * grid.taps_c.shape[1]
    n_r = lens.rows * grid.fine_r
    image = _Amplitude(
        np.zeros((n_c, n_r), np.float32), np.zeros((n_c, n_r), np.float32),
        np.full(n_c, n_r), np.full(n_c, -1),
    )  # fmt: skip
    light = np.zeros((lens.columns, lens.rows), np.float64)
    level = np.empty(lens.rows)
    spilt = np.empty(lens.rows)
    out_row = np.full((profiles, lens.columns), np.nan)
    out_peak = np.zeros((profiles, lens.columns))
    kept = np.zeros((lens.columns, lens.rows))
    for i in range(profiles):
        light[:] = 0.0
        for k in range(images):
            for layer in range(lit.layers.size):
                _add_layer(image, lit, layer, where[i, k], sheet, lens, grid, images)
                _collect(image, grid, light)
        _add_glow(glow[i], light)
        for c in range(lens.columns):
            _read_out(light, chip, i, c, level, spilt, rng)
            if i == keep:
                kept[c] = level
            out_row[i, c], out_peak[i, c] = locate(level, lens.rows, chip.kind, chip.threshold)
    return out_row, out_peak, kept


def _taps(spread: float) -> NDArray[np.float32]:
    """Amplitude of a point image on the fine grid for 64 sub-positions, unit power."""
    reach = 2 * max(1, int(np.ceil(2.6 * spread)))
    at = np.arange(reach) - (reach // 2 - 1)
    bins = (np.arange(_TAP_BINS) + 0.5) / _TAP_BINS
    amplitude = np.exp(-0.5 * ((at[None, :] - bins[:, None]) / spread) ** 2)
    power = np.sum(amplitude**2, axis=1, keepdims=True)
    return np.asarray(amplitude / np.sqrt(power), np.float32)


def expose(
    stripes: Stripes,
    sheet: LaserSheet,
    camera: Camera,
    finder: PeakFinder,
    faults: Faults,
    where_mm: NDArray[np.float64],
    time_s: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    translucence_mm: float = 0.0,
    glow: NDArray[np.float32] | None = None,
    keep: int = -1,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Take a frame for each profile and find the line in it.

    The image is the squared modulus of the scatterers' amplitudes, each ``sqrt(power)`` with
    its own phase, spread by the lens; images at other instants of the exposure, of light
    from other depths below the surface and of second bounces add as intensities.

    Parameters
    ----------
    where_mm : (n, k, 3)
        The sensor's true position in the stripes' frame at k instants of each exposure.
    time_s : (n,)
        Start of each exposure, for the ambient light.
    translucence_mm
        Mean path below the surface.
    glow : (n, q, 3), optional
        Second bounces: column, row, power.
    keep
        Profile whose frame is returned.

    Returns
    -------
    row : (n, columns)
        Sub-pixel row in the finder's steps, NaN without a line.
    peak : (n, columns)
        Brightest count over full scale, 0 to 1.
    frame : (columns, rows)
        Counts of the profile `keep`.
    """
    grain = camera.amplitude_spread_mm(sheet.wavelength_mm)
    fine_c = max(1, int(np.ceil(camera.column_pitch_mm / (1.3 * grain))))
    fine_r = max(2, int(np.ceil(camera.row_pitch_mm / (1.3 * grain))))
    spread_c = grain / camera.column_pitch_mm * fine_c
    spread_r = grain / camera.row_pitch_mm * fine_r
    # exposure: a white plate at the working distance fills `fill` of the well
    foreshortened = sheet.waist_mm * np.cos(camera.triangulation_rad)
    sigma_rows = np.hypot(foreshortened, grain / sqrt(2)) / camera.row_pitch_mm
    line = camera.fill * camera.full_well_e / erf(0.5 / (sqrt(2) * sigma_rows))
    column = np.linspace(-1, 1, camera.columns)
    dirt = faults.window_dip * np.exp(
        -0.5 * ((column - faults.window_at) / faults.window_width) ** 4
    )
    tilt = 1 + camera.ambient_tilt * np.linspace(-1, 1, camera.rows)
    beat = 1 + camera.ambient_ripple * np.sin(2 * np.pi * camera.ambient_hz * time_s)
    ambient = camera.ambient_e * beat[:, None] * tilt[None, :]
    layers = np.zeros(1)
    if translucence_mm > 0:
        layers = -translucence_mm * np.log(1 - (np.arange(4) + 0.5) / 4)
    full_scale = 2.0**camera.bits - 1
    scale, threshold = full_scale / camera.full_well_e, finder.threshold * full_scale
    row, peak, frame = _frames(
        _Scatterers(
            stripes.y_mm, stripes.x_mm, stripes.z_mm, stripes.power, stripes.cosine, stripes.sine,
            stripes.below, layers,
        ),
        _Sheet(
            sheet.waist_mm, sheet.waist_z_mm, sheet.rayleigh_mm,
            stripes.spacing_mm / (np.sqrt(2 * np.pi) * sheet.waist_mm) / stripes.samples,
        ),
        _Lens(
            camera.columns, camera.rows, camera.step_rad, camera.fov_rad / 2, camera.focal_rows,
            np.tan(camera.triangulation_rad), float(camera.side), camera.base_mm,
            camera.smile, camera.keystone, camera.barrel,
        ),
        _Grid(fine_c, fine_r, _taps(spread_c), _taps(spread_r)),
        _Chip(
            line * (1 - dirt), ambient, camera.full_well_e, camera.read_noise_e, scale,
            camera.bloom, KINDS.index(finder.kind), threshold, faults.spikes,
            threshold > scale * (camera.read_noise_e * 7 + ambient.max()),
        ),
        where_mm,
        np.zeros((where_mm.shape[0], 0, 3), np.float32) if glow is None else glow,
        rng,
        keep,
    )  # fmt: skip
    digits = 2.0**finder.fraction_bits
    return np.floor(row * digits + 0.5) / digits, peak / full_scale, frame
