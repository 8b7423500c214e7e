"""The coherent image of the lit scatterers on the chip: amplitudes add on a fine grid."""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FASTMATH: Final = {"contract", "reassoc", "arcp", "nsz"}
"""What the compiler may take for granted: all but what NaN and infinity need."""

_TAP_BINS = 64


class Scatterers(NamedTuple):
    """The lit surface: (G,) lines of (G, M) points, mm; power and phase of each."""

    y: NDArray[np.float64]
    x: NDArray[np.float64]
    z: NDArray[np.float64]
    power: NDArray[np.float32]
    cosine: NDArray[np.float32]
    sine: NDArray[np.float32]
    below: NDArray[np.float32]
    layers: NDArray[np.float64]  # mm below the surface that the light turns at


class Sheet(NamedTuple):
    """The laser sheet, mm, and the share of its power that one scatterer has."""

    waist: float
    waist_z: float
    rayleigh: float
    share: float


class Lens(NamedTuple):
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


class Grid(NamedTuple):
    """The fine grid on which amplitudes add: points a pixel, and a point's image on it."""

    fine_c: int
    fine_r: int
    taps_c: NDArray[np.float32]
    taps_r: NDArray[np.float32]


class Amplitude(NamedTuple):
    """Amplitude on the fine grid, and the rows that are lit in each of its columns."""

    real: NDArray[np.float32]
    imag: NDArray[np.float32]
    low: NDArray[np.int64]
    high: NDArray[np.int64]


@njit(cache=True, fastmath=FASTMATH)
def add_layer(
    image: Amplitude,
    lit: Scatterers,
    layer: int,
    at_mm: NDArray[np.float64],
    sheet: Sheet,
    lens: Lens,
    grid: Grid,
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


@njit(cache=True, fastmath=FASTMATH)
def collect(image: Amplitude, grid: Grid, light: NDArray[np.float64]) -> None:
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


@njit(cache=True, fastmath=FASTMATH)
def add_glow(glow: NDArray[np.float32], light: NDArray[np.float64]) -> None:
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


def taps(spread: float) -> NDArray[np.float32]:
    """Amplitude of a point image on the fine grid for 64 sub-positions, unit power."""
    reach = 2 * max(1, int(np.ceil(2.6 * spread)))
    at = np.arange(reach) - (reach // 2 - 1)
    bins = (np.arange(_TAP_BINS) + 0.5) / _TAP_BINS
    amplitude = np.exp(-0.5 * ((at[None, :] - bins[:, None]) / spread) ** 2)
    power = np.sum(amplitude**2, axis=1, keepdims=True)
    return np.asarray(amplitude / np.sqrt(power), np.float32)
