"""Correlation of Perlin speckle between two points: closed form, or measured on drawn fields.

With unit gradients of uniform direction an octave is the sum over control points of
gx·ramp(x)·bump(y) + gy·bump(x)·ramp(y) (w and t·w of `sensors.noise.perlin`), so that at the
lag (s, t) in cells its covariance, averaged over the place in the cell, is
½ (R(s) B(t) + B(s) R(t)), B and R the autocorrelations of bump and ramp. It ends at two cells.
"""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from sensors.noise.lay import sample_lay
from sensors.noise.measured_field import MeasuredField
from sensors.noise.perlin import OCTAVE_SD, PerlinField, smoothstep
from sensors.noise.speckle import Speckle

Floats = NDArray[np.float64]

REACH_CELLS = 2.0  # control points farther apart share no bump
POINTS = 1_000_000  # that a measured correlation is averaged over
TOGETHER = 16  # fields that are transformed at a time
ROUNDING = 0.02  # of the logarithm of the grid's steps
NODES = 2001  # of the table of B and R over 0 to 2 cells; linear between, error below 1e-6


def speckle_kernel(
    field: Speckle,
    pitch_x_mm: float,
    pitch_y_mm: float,
    *,
    lay_ratio: float = 1.0,
    lay_angle_rad: float = 0.0,
) -> Floats:
    """Return the speckle's correlation at all lags of a scan's grid at which it isn't zero.

    A field with a map of heights has no closed form: a map of values that aren't normal fills the
    spectrum at low frequencies. Its correlation is measured on fields drawn from a seed of its own,
    at steps of the grid rounded to `ROUNDING`, so that scans share it.

    Parameters
    ----------
    field
        The speckle.
    pitch_x_mm, pitch_y_mm
        Steps of the grid along the line and along the travel, mm; 0 for a single row or column.
    lay_ratio, lay_angle_rad
        Stretch of the field along a direction, see `sensors.noise.lay.sample_lay`.

    Returns
    -------
    (2a + 1, 2b + 1) array
        1 in the middle; rows are lags along the travel.
    """
    if isinstance(field, MeasuredField):
        reach = max(field.reach_mm) * max(lay_ratio, 1 / lay_ratio) ** 0.5
        if lay_ratio == 1.0:
            lags = [_lags(r, p) for r, p in zip(field.reach_mm, (pitch_x_mm, pitch_y_mm),
                                                strict=True)]  # fmt: skip
        else:
            lags = [_lags(reach, pitch) for pitch in (pitch_x_mm, pitch_y_mm)]
        return field.correlation_at(*lags, lay_ratio=lay_ratio, lay_angle_rad=lay_angle_rad)
    if field.heights is None:
        return _closed_form(field, pitch_x_mm, pitch_y_mm, lay_ratio, lay_angle_rad)
    return _measured(field, _rounded(pitch_x_mm), _rounded(pitch_y_mm), lay_ratio, lay_angle_rad)


def _rounded(pitch_mm: float) -> float:
    if pitch_mm <= 0:
        return 0.0
    return math.exp(round(math.log(pitch_mm) / ROUNDING) * ROUNDING)


def _octaves_and_lags(
    field: PerlinField, pitch_x_mm: float, pitch_y_mm: float, ratio: float, angle_rad: float
) -> tuple[list[tuple[float, float, float]], Floats, Floats]:
    """Return the octaves as drawn, in the lay's axes, and the grid's lags (columns, rows)."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    stretch = math.sqrt(ratio)
    stretched = dataclasses.replace(
        field, cell_x_mm=field.cell_x_mm * stretch, cell_y_mm=field.cell_y_mm / stretch
    )
    octaves = stretched.drawn_octaves(
        math.hypot(pitch_x_mm * cosine, pitch_y_mm * sine),
        math.hypot(pitch_x_mm * sine, pitch_y_mm * cosine),
    )
    long_u = REACH_CELLS * max(u for _, u, _ in octaves)
    long_v = REACH_CELLS * max(v for _, _, v in octaves)
    x = _lags(abs(cosine) * long_u + abs(sine) * long_v, pitch_x_mm)
    y = _lags(abs(sine) * long_u + abs(cosine) * long_v, pitch_y_mm)
    return octaves, x, y


def _closed_form(
    field: PerlinField, pitch_x_mm: float, pitch_y_mm: float, ratio: float, angle_rad: float
) -> Floats:
    if ratio == 1.0:
        angle_rad = 0.0
    octaves, x, y = _octaves_and_lags(field, pitch_x_mm, pitch_y_mm, ratio, angle_rad)
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    u, v = cosine * x + sine * y[:, None], cosine * y[:, None] - sine * x
    total = sum(gain**2 * _octave(u / cell_u, v / cell_v) for gain, cell_u, cell_v in octaves)
    return np.asarray(total / sum(gain**2 for gain, _, _ in octaves), dtype=np.float64)


@functools.lru_cache(maxsize=256)
def _measured(
    field: PerlinField, pitch_x_mm: float, pitch_y_mm: float, ratio: float, angle_rad: float
) -> Floats:
    if ratio == 1.0:
        angle_rad = 0.0
    _, *lags = _octaves_and_lags(field, pitch_x_mm, pitch_y_mm, ratio, angle_rad)
    half_x, half_y = (lag.size // 2 for lag in lags)
    x: Floats = np.arange(max(16 * half_x, 1), dtype=np.float64) * np.float64(pitch_x_mm)
    y: Floats = np.arange(max(16 * half_y, 1), dtype=np.float64) * np.float64(pitch_y_mm)
    rng = np.random.default_rng(0)
    count = math.ceil(POINTS / (x.size * y.size))
    if ratio == 1.0:
        fields = field.samples(x, y, rng, count)
    else:
        fields = np.stack([sample_lay(field, x, y, ratio, angle_rad, rng) for _ in range(count)])
    mean = float(np.mean(fields))
    padded = (y.size + half_y, x.size + half_x)  # so that no lag in reach wraps around
    power = np.zeros((padded[0], padded[1] // 2 + 1))
    for first in range(0, count, TOGETHER):
        for one in np.abs(np.fft.rfft2(fields[first : first + TOGETHER] - mean, padded)) ** 2:
            power += one  # one by one: sums don't depend on how many are transformed together
    products = np.fft.irfft2(power, padded)
    rows, columns = np.arange(-half_y, half_y + 1), np.arange(-half_x, half_x + 1)
    overlap = np.outer(y.size - np.abs(rows), x.size - np.abs(columns))
    kernel = products[np.ix_(rows, columns)] / overlap
    kernel.flags.writeable = False
    return np.asarray(kernel / kernel[half_y, half_x], dtype=np.float64)


def _lags(reach_mm: float, pitch_mm: float) -> Floats:
    most = math.ceil(reach_mm / pitch_mm) if pitch_mm > 0 else 0
    return np.arange(-most, most + 1, dtype=np.float64) * np.float64(pitch_mm)


def _octave(s: Floats, t: Floats) -> Floats:
    lag, bump, ramp = _table()

    def at(values: Floats, cells: Floats) -> Floats:
        return np.interp(np.abs(cells), lag, values, right=0.0)

    product = at(ramp, s) * at(bump, t) + at(bump, s) * at(ramp, t)
    return np.asarray(0.5 * product / OCTAVE_SD**2)


@functools.cache
def _table() -> tuple[Floats, Floats, Floats]:
    """Lags 0 to 2 cells, and the autocorrelations B and R of bump and ramp there."""
    t = np.linspace(-1.0, 1.0, NODES)
    bump = 1.0 - smoothstep(np.abs(t))
    step = t[1] - t[0]
    lag = np.arange(NODES) * step
    pair = [np.correlate(w, w, mode="full")[NODES - 1 :] * step for w in (bump, t * bump)]
    return lag, pair[0], pair[1]
