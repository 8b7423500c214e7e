"""An upright telecentric camera with two-dimensional distortion, and its chip and finders."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FINDERS = ("strongest", "first", "last", "gaussian")
WINDOW, MATCHED, STEPS = 2.5, 1.8, 60
"""Standard deviations of the finders' windows, pixels, and steps until they settle at most.

A parabola through three pixels would lock to the rows by up to 0.07 pixel, as much as the noise:
an effect of the catalogue in every null. A test holds the finders to 0.005.
"""
MARGIN = 3
"""Columns of the chip beyond each end of what is delivered: the lens spreads light from there, too.

Without them the end columns of every instrument were off by up to 0.9 of the noise on slopes.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Camera:
    """Telecentric camera: every sight line runs along its axis.

    Attributes
    ----------
    theta_rad : between the sheet and the camera's axis
    side : +1 with the camera on +y of the sheet
    rows, row_pitch_mm : of the chip, as seen on the part
    columns, x_fov_mm : readings of a delivered profile, and what they span; the chip is wider by
        `MARGIN` at each end
    blur_rows, blur_columns : standard deviation of the lens's spread, pixels
    bend_rows, shear_rows, barrel : distortion over the field, see `row_of` and `columns_mm`
    electrons : of a pixel for unit light
    full_well, read_noise_e, bits : chip
    """

    theta_rad: float
    side: int
    rows: int
    row_pitch_mm: float
    columns: int
    x_fov_mm: float
    blur_rows: float = 1.1
    blur_columns: float = 0.5
    bend_rows: float = 0.0
    shear_rows: float = 0.0
    barrel: float = 0.0
    electrons: float = 90000.0
    full_well: float = 15000.0
    read_noise_e: float = 12.0
    bits: int = 12

    @property
    def footprint_mm(self) -> float:
        """Spread along the line of what a delivered reading is the mean of, mm.

        The lens's, and that of interpolation between neighbours at shares f and 1 - f: f (1 - f)
        of a squared pitch, mean over the line. Little where the barrel moves less than a column.
        """
        pitch = self.x_fov_mm / (self.columns - 1)
        _, share = self.between
        interpolated = float(np.mean(share * (1 - share)))
        return float(pitch * np.hypot(self.blur_columns, np.sqrt(interpolated)))

    @property
    def between(self) -> tuple[NDArray[np.int64], Floats]:
        """Chip column before each place on even x, and the share of the next one in a reading."""
        chip = self.columns_mm
        at = np.interp(self.even_mm, chip, np.arange(chip.size))
        left = np.minimum(at.astype(np.int64), chip.size - 2)
        return left, at - left

    @property
    def even_mm(self) -> Floats:
        """Even places along the line that a rectified profile is delivered at, mm."""
        return np.linspace(-self.x_fov_mm / 2, self.x_fov_mm / 2, self.columns)

    @property
    def columns_mm(self) -> Floats:
        """Where the chip's columns look, barrel included, mm."""
        end = 1 + 2 * MARGIN / (self.columns - 1)
        u = np.linspace(-end, end, self.columns + 2 * MARGIN)
        return np.asarray(self.x_fov_mm / 2 * u * (1 + self.barrel * (1 - u**2)))

    @property
    def lens(self) -> "Lens":
        """The lens's blur as weights of pixels."""
        return Lens(rows=taps(self.blur_rows), columns=taps(self.blur_columns))

    def row_of(self, x_mm: Floats, y_mm: Floats, z_mm: Floats) -> Floats:
        """Row in which a point of the sensor frame, z from the middle of the range, is seen.

        A telecentric lens projects on the axis across its sight lines, in the y-z plane:
        v = y cos θ + κ z sin θ.
        """
        v = y_mm * np.cos(self.theta_rad) + self.side * z_mm * np.sin(self.theta_rad)
        u = 2 * x_mm / self.x_fov_mm
        half = self.rows / 2
        row = half + v / self.row_pitch_mm
        w = (row - half) / half
        return np.asarray(row + self.bend_rows * u**2 + self.shear_rows * u * w)


def taps(sd: float) -> Floats:
    """Weights of a Gaussian spread over pixels, sum 1."""
    reach = max(1, int(np.ceil(3 * sd)))
    k = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sd, 1e-3)) ** 2)
    return np.asarray(k / k.sum())


@njit(cache=True)
def settled(level: Floats, at: float, width: float) -> float:
    """Mean shift of a row under a Gaussian window: the top of the smoothed line.

    Cheng, IEEE PAMI 17 (1995) 790. A line of spread σ is approached by σ²/(σ² + width²) a step.
    """
    x = at
    reach = int(np.ceil(4 * width))
    for _ in range(STEPS):
        total = moment = 0.0
        for r in range(max(int(x) - reach, 0), min(int(x) + reach + 2, level.size)):
            w = level[r] * np.exp(-0.5 * ((r - x) / width) ** 2)
            total += w
            moment += w * r
        if total <= 0.0:
            return x
        new = moment / total
        if abs(new - x) < 1e-9:
            return new
        x = new
    return x


@njit(cache=True)
def find_row(level: Floats, kind: int, threshold: float) -> float:
    """Row of the line in one column of counts, NaN without one.

    strongest, first, last: the soft centre of gravity about the brightest pixel, or about the first
    or last local peak above the threshold; gaussian: a Gaussian matched to the line, at its best.
    """
    rows, at = level.size, -1
    for r in range(1, rows - 1):
        if level[r] < threshold or level[r] < level[r - 1] or level[r] <= level[r + 1]:
            continue
        if at < 0 or kind == 2 or (kind in (0, 3) and level[r] > level[at]):
            at = r
    if at < 1:
        return np.nan
    return settled(level, float(at), MATCHED if kind == 3 else WINDOW)


class Lens(NamedTuple):
    """Weights of the lens's blur along rows and columns, each of sum 1."""

    rows: Floats
    columns: Floats


class Chip(NamedTuple):
    """From light to counts in one exposure, and from counts to the line's row."""

    electrons: float  # of a pixel for unit light
    ambient: float  # electrons of stray light in a pixel
    full_well: float  # electrons
    read_noise: float  # electrons
    top: float  # largest count
    kind: int  # of the finder: its place in `FINDERS`
    threshold: float  # counts


@njit(cache=True)
def _fallen(light: Floats, row: Floats, loose: Floats, rows: int) -> Floats:
    """Light (columns, rows) on the chip before the lens's blur, shared by neighbouring rows."""
    cells, columns = light.shape
    sharp = np.zeros((columns, rows))
    for i in range(cells):
        for j in range(columns):
            v = row[i, j]
            if not (0.0 <= v < rows - 1.0):
                continue
            low = int(v)
            sharp[j, low] += light[i, j] * (low + 1 - v)
            sharp[j, low + 1] += light[i, j] * (v - low)
    for i in range(loose.shape[0]):
        j, v = int(loose[i, 0]), loose[i, 1]
        if 0 <= j < columns and 0.0 <= v < rows - 1.0:
            sharp[j, int(v)] += loose[i, 2] * (int(v) + 1 - v)
            sharp[j, int(v) + 1] += loose[i, 2] * (v - int(v))
    return sharp


@njit(cache=True)
def _blurred_along_rows(sharp: Floats, weights: Floats) -> Floats:
    """Spread each column's light (columns, rows) over its rows; the image ends at the chip."""
    columns, rows = sharp.shape
    half = weights.size // 2
    blurred = np.zeros((columns, rows))
    for j in range(columns):
        for r in range(rows):
            if sharp[j, r] != 0.0:
                for t in range(weights.size):
                    q = r + t - half
                    if 0 <= q < rows:
                        blurred[j, q] += sharp[j, r] * weights[t]
    return blurred


@njit(cache=True)
def expose(
    light: Floats, row: Floats, loose: Floats, lens: Lens, chip: Chip, normal: Floats
) -> tuple[Floats, Floats]:
    """Image one profile's light and find its rows.

    Parameters
    ----------
    light, row : (k, columns)
        Power of each lit cell, and the row in which it is seen.
    loose : (n, 3)
        Column, row and power of light from elsewhere.
    normal : (columns, rows)
        Standard normal numbers for shot and read noise.

    Returns
    -------
    found : (columns,) row, NaN without a line
    peak : (columns,) brightest count over the converter's top
    """
    columns, rows = normal.shape
    blurred = _blurred_along_rows(_fallen(light, row, loose, rows), lens.rows)
    half = lens.columns.size // 2
    found, peak = np.full(columns, np.nan), np.zeros(columns)
    level = np.empty(rows)
    for j in range(columns):
        for r in range(rows):
            total = 0.0
            for t in range(lens.columns.size):
                q = min(max(j + t - half, 0), columns - 1)
                total += blurred[q, r] * lens.columns[t]
            mean = chip.electrons * total + chip.ambient
            charge = mean + np.sqrt(mean + chip.read_noise**2) * normal[j, r]
            filled = min(max(charge, 0.0), chip.full_well) / chip.full_well
            level[r] = np.floor(filled * chip.top + 0.5)
        found[j] = find_row(level, chip.kind, chip.threshold)
        peak[j] = level.max() / chip.top
    return found, peak
