"""Camera frames: coherent image of the lit scatterers, exposure, chip noise, peak rows."""

from dataclasses import dataclass
from math import erf, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.camera import Camera
from challenge.instrument.coherent_image import (
    FASTMATH,
    Amplitude,
    Grid,
    Lens,
    Scatterers,
    Sheet,
    add_glow,
    add_layer,
    collect,
    taps,
)
from challenge.instrument.peaks import KINDS, PeakFinder, locate
from challenge.instrument.readout import Chip, read_out
from challenge.instrument.sheet import LaserSheet
from challenge.instrument.stripes import Stripes

LAYERS = 4
"""Depths below a translucent surface at which light turns."""


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

    def passed(self, columns: int) -> NDArray[np.float64]:
        """Share (columns,) of the light that the window passes."""
        column = np.linspace(-1, 1, columns)
        away = (column - self.window_at) / self.window_width
        return np.asarray(1 - self.window_dip * np.exp(-0.5 * away**4))


@njit(cache=True, fastmath=FASTMATH)
def _frames(
    lit: Scatterers,
    sheet: Sheet,
    lens: Lens,
    grid: Grid,
    chip: Chip,
    where: NDArray[np.float64],  # (profiles, sub-exposures, 3): true position of the sensor
    glow: NDArray[np.float32],  # (profiles, k, 3): column, row, power of second bounces
    rng: np.random.Generator,
    keep: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Render, expose and read out every profile; see `expose` for the physics."""
    profiles, images = where.shape[0], where.shape[1]
    n_c = lens.columns * grid.fine_c + 2 * grid.taps_c.shape[1]
    n_r = lens.rows * grid.fine_r
    image = Amplitude(
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
                add_layer(image, lit, layer, where[i, k], sheet, lens, grid, images)
                collect(image, grid, light)
        add_glow(glow[i], light)
        for c in range(lens.columns):
            read_out(light, chip, i, c, level, spilt, rng)
            if i == keep:
                kept[c] = level
            out_row[i, c], out_peak[i, c] = locate(level, lens.rows, chip.kind, chip.threshold)
    return out_row, out_peak, kept


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
    grain_mm = camera.amplitude_spread_mm(sheet.wavelength_mm)
    row, peak, frame = _frames(
        _scatterers(stripes, translucence_mm),
        _lit_by(sheet, stripes),
        _lens(camera),
        _fine_grid(camera, grain_mm),
        _chip(camera, finder, faults, _full_line_e(camera, sheet, grain_mm), time_s),
        where_mm,
        np.zeros((where_mm.shape[0], 0, 3), np.float32) if glow is None else glow,
        rng,
        keep,
    )
    digits = 2.0**finder.fraction_bits
    return np.floor(row * digits + 0.5) / digits, peak / _full_scale(camera), frame


def _scatterers(stripes: Stripes, translucence_mm: float) -> Scatterers:
    """Pack the lit surface; light turns at four depths below it, of equal shares of the power."""
    layers = np.zeros(1)
    if translucence_mm > 0:
        layers = -translucence_mm * np.log(1 - (np.arange(LAYERS) + 0.5) / LAYERS)
    return Scatterers(
        stripes.y_mm, stripes.x_mm, stripes.z_mm, stripes.power, stripes.cosine, stripes.sine,
        stripes.below, layers,
    )  # fmt: skip


def _lit_by(sheet: LaserSheet, stripes: Stripes) -> Sheet:
    """Pack the laser sheet with the share of its power that one scatterer has."""
    share = stripes.spacing_mm / (np.sqrt(2 * np.pi) * sheet.waist_mm) / stripes.samples
    return Sheet(sheet.waist_mm, sheet.waist_z_mm, sheet.rayleigh_mm, share)


def _lens(camera: Camera) -> Lens:
    """Pack what tells the pixel in which a point is imaged."""
    return Lens(
        camera.columns, camera.rows, camera.step_rad, camera.fov_rad / 2, camera.focal_rows,
        np.tan(camera.triangulation_rad), float(camera.side), camera.base_mm,
        camera.smile, camera.keystone, camera.barrel,
    )  # fmt: skip


def _fine_grid(camera: Camera, grain_mm: float) -> Grid:
    """Choose a grid on which the image of one point, `grain_mm` wide, is resolved."""
    fine_c = max(1, int(np.ceil(camera.column_pitch_mm / (1.3 * grain_mm))))
    fine_r = max(2, int(np.ceil(camera.row_pitch_mm / (1.3 * grain_mm))))
    spread_c = grain_mm / camera.column_pitch_mm * fine_c
    spread_r = grain_mm / camera.row_pitch_mm * fine_r
    return Grid(fine_c, fine_r, taps(spread_c), taps(spread_r))


def _full_line_e(camera: Camera, sheet: LaserSheet, grain_mm: float) -> float:
    """Electrons of a column's whole line: a white plate's brightest pixel fills `fill` of a well.

    The plate stands at the working distance.
    """
    foreshortened = sheet.waist_mm * np.cos(camera.triangulation_rad)
    sigma_rows = np.hypot(foreshortened, grain_mm / sqrt(2)) / camera.row_pitch_mm
    return float(camera.fill * camera.full_well_e / erf(0.5 / (sqrt(2) * sigma_rows)))


def _ambient_e(camera: Camera, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Electrons (profiles, rows) of ambient light: tilted over the rows, beating with the mains."""
    tilt = 1 + camera.ambient_tilt * np.linspace(-1, 1, camera.rows)
    beat = 1 + camera.ambient_ripple * np.sin(2 * np.pi * camera.ambient_hz * time_s)
    return np.asarray(camera.ambient_e * beat[:, None] * tilt[None, :])


def _chip(
    camera: Camera, finder: PeakFinder, faults: Faults, line_e: float, time_s: NDArray[np.float64]
) -> Chip:
    """Pack what turns light into counts, and counts into the line's row."""
    ambient = _ambient_e(camera, time_s)
    scale = _full_scale(camera) / camera.full_well_e
    threshold = finder.threshold * _full_scale(camera)
    return Chip(
        electrons=line_e * faults.passed(camera.columns), ambient=ambient,
        full_well=camera.full_well_e, read_noise=camera.read_noise_e, scale=scale,
        bloom=camera.bloom, kind=KINDS.index(finder.kind), threshold=threshold,
        spikes=faults.spikes,
        quiet=bool(threshold > scale * (camera.read_noise_e * 7 + ambient.max())),
    )  # fmt: skip


def _full_scale(camera: Camera) -> float:
    """Largest count."""
    return float(2.0**camera.bits - 1)
