"""Camera frames: coherent image of the lit scatterers, exposure, chip noise, peak rows."""

from dataclasses import dataclass
from math import erf, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.camera import Camera
from challenge.instrument.peaks import KINDS, PeakFinder, locate
from challenge.instrument.sheet import LaserSheet
from challenge.instrument.stripes import Stripes

_TAP_BINS = 64


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


@njit(cache=True, fastmath={"contract", "reassoc", "arcp", "nsz"})
def _frames(
    y: NDArray[np.float64],
    x: NDArray[np.float64],
    z: NDArray[np.float64],
    power: NDArray[np.float32],
    cosine: NDArray[np.float32],
    sine: NDArray[np.float32],
    below: NDArray[np.float32],
    layers: NDArray[np.float64],
    where: NDArray[np.float64],  # (profiles, sub-exposures, 3): true position of the sensor
    glow: NDArray[np.float32],  # (profiles, k, 3): column, row, power of second bounces
    waist: float,
    waist_z: float,
    rayleigh: float,
    share: float,
    columns: int,
    rows: int,
    step_rad: float,
    half_fov: float,
    focal: float,
    tan_0: float,
    side: float,
    base: float,
    smile: float,
    keystone: float,
    barrel: float,
    fine_c: int,
    fine_r: int,
    taps_c: NDArray[np.float32],
    taps_r: NDArray[np.float32],
    electrons: NDArray[np.float64],  # (columns,): of the whole line on the white plate
    ambient: NDArray[np.float64],  # (profiles, rows)
    full_well: float,
    read_noise: float,
    scale: float,
    bloom: float,
    kind: int,
    threshold: float,
    spikes: float,
    rng: np.random.Generator,
    keep: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Render, expose and read out every profile; see `expose` for the physics."""
    profiles, parts = where.shape[0], where.shape[1]
    reach_c, reach_r = taps_c.shape[1], taps_r.shape[1]
    n_c, n_r = columns * fine_c, rows * fine_r
    real = np.zeros((n_c + 2 * reach_c, n_r), np.float32)
    imag = np.zeros((n_c + 2 * reach_c, n_r), np.float32)
    low = np.full(n_c + 2 * reach_c, n_r)
    high = np.full(n_c + 2 * reach_c, -1)
    light = np.zeros((columns, rows), np.float64)
    level = np.empty(rows)
    spilt = np.empty(rows)
    out_row = np.full((profiles, columns), np.nan)
    out_peak = np.zeros((profiles, columns))
    kept = np.zeros((columns, rows))
    count_layers = layers.size
    deep = below.shape[0] > 1
    quiet = threshold > scale * (read_noise * 7 + ambient.max())
    for i in range(profiles):
        light[:] = 0.0
        for part in range(parts):
            off_x, off_y, off_z = where[i, part]
            for layer in range(count_layers):
                for g in range(y.size):
                    eta = y[g] - off_y
                    if abs(eta) > 12 * waist:
                        continue
                    for m in range(x.shape[1]):
                        strength = power[g, m]
                        if strength <= 0:
                            continue
                        depth = z[g, m] - off_z
                        wide = 1 + ((depth - waist_z) / rayleigh) ** 2
                        q = eta * eta / (waist * waist * wide)
                        if q > 12.25:
                            continue
                        amplitude = sqrt(
                            strength * share * np.exp(-0.5 * q) / sqrt(wide) / count_layers / parts
                        )
                        px, py = x[g, m] - off_x, eta
                        if deep:
                            px += layers[layer] * below[g, m, 0]
                            py += layers[layer] * below[g, m, 1]
                            depth += layers[layer] * below[g, m, 2]
                        row = focal * (tan_0 + (side * py - base) / depth)
                        bearing = np.arctan(px / depth)
                        u, v = bearing / half_fov, 2 * row / rows
                        row += smile * u * u + keystone * u * v + barrel * v * (u * u + v * v)
                        # position of the point image on the fine grid, pixel centres integer
                        fr = ((rows - 1) / 2 + row + 0.5) * fine_r - 0.5
                        fc = (bearing / step_rad + (columns - 1) / 2 + 0.5) * fine_c - 0.5 + reach_c
                        r0, c0 = int(np.floor(fr)), int(np.floor(fc))
                        br = int((fr - r0) * 64)
                        bc = int((fc - c0) * 64)
                        r0 -= reach_r // 2 - 1
                        c0 -= reach_c // 2 - 1
                        if r0 < 0 or r0 + reach_r >= n_r or c0 < 0 or c0 + reach_c >= real.shape[0]:
                            continue
                        other = (m + 37 * layer) % x.shape[1]
                        re = np.float32(amplitude * cosine[g, other])
                        im = np.float32(amplitude * sine[g, other])
                        tap = taps_r[br]
                        for c in range(reach_c):
                            a, b = re * taps_c[bc, c], im * taps_c[bc, c]
                            col = c0 + c
                            in_real = real[col, r0 : r0 + reach_r]
                            in_imag = imag[col, r0 : r0 + reach_r]
                            for r in range(reach_r):
                                in_real[r] += a * tap[r]
                                in_imag[r] += b * tap[r]
                            low[col] = min(low[col], r0)
                            high[col] = max(high[col], r0 + reach_r)
                for col in range(real.shape[0]):
                    c = (col - reach_c) // fine_c
                    for r in range(low[col], high[col]):
                        if 0 <= c < columns:
                            light[c, r // fine_r] += (
                                real[col, r] * real[col, r] + imag[col, r] * imag[col, r]
                            )
                        real[col, r] = 0.0
                        imag[col, r] = 0.0
                    low[col] = n_r
                    high[col] = -1
        for k in range(glow.shape[1]):
            if glow[i, k, 2] <= 0:
                continue
            c0, r0 = int(round(glow[i, k, 0])), int(round(glow[i, k, 1]))
            for c in range(c0 - 1, c0 + 2):
                for r in range(r0 - 3, r0 + 4):
                    if 0 <= c < columns and 0 <= r < rows:
                        dc, dr = c - glow[i, k, 0], r - glow[i, k, 1]
                        light[c, r] += glow[i, k, 2] * np.exp(-0.5 * (dc * dc + dr * dr)) / 6.2832
        for c in range(columns):
            stray_row, stray = -1, 0.0
            if spikes > 0 and rng.random() < spikes:
                stray_row = int(rng.random() * rows)
                stray = full_well * (0.3 + 0.9 * rng.random())
            for r in range(rows):
                mean = light[c, r] * electrons[c]
                if r == stray_row:
                    mean += stray
                level[r] = ambient[i, r]
                if mean >= 1.0 or not quiet:
                    mean += level[r]
                    level[r] = mean + sqrt(mean + read_noise * read_noise) * rng.standard_normal()
            _spill(level, spilt, full_well, bloom)
            for r in range(rows):
                level[r] = np.floor(level[r] * scale + 0.5)
                if i == keep:
                    kept[c, r] = level[r]
            row, peak = locate(level, rows, kind, threshold)
            out_row[i, c] = row
            out_peak[i, c] = peak
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
    row, peak, frame = _frames(
        stripes.y_mm, stripes.x_mm, stripes.z_mm, stripes.power, stripes.cosine, stripes.sine,
        stripes.below, layers, where_mm,
        np.zeros((where_mm.shape[0], 0, 3), np.float32) if glow is None else glow,
        sheet.waist_mm, sheet.waist_z_mm, sheet.rayleigh_mm,
        stripes.spacing_mm / (np.sqrt(2 * np.pi) * sheet.waist_mm) / stripes.samples,
        camera.columns, camera.rows, camera.step_rad, camera.fov_rad / 2, camera.focal_rows,
        np.tan(camera.triangulation_rad), float(camera.side), camera.base_mm,
        camera.smile, camera.keystone, camera.barrel, fine_c, fine_r,
        _taps(spread_c), _taps(spread_r), line * (1 - dirt), ambient,
        camera.full_well_e, camera.read_noise_e, full_scale / camera.full_well_e, camera.bloom,
        KINDS.index(finder.kind), finder.threshold * full_scale, faults.spikes, rng, keep,
    )  # fmt: skip
    digits = 2.0**finder.fraction_bits
    return np.floor(row * digits + 0.5) / digits, peak / full_scale, frame
