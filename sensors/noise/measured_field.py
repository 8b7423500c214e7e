"""Noise with a measured autocorrelation: impulses at random places, each spread by one kernel.

Sparse convolution (Lewis, SIGGRAPH 1989, "Algorithms for solid noise synthesis"): every cell of a
lattice holds impulses of height ±1 at places uniform in the cell. Their sum, spread by a kernel h,
is stationary with the autocovariance h * h, whatever the pitch of the scan; an octave of Perlin
noise has one band and no negative correlation between neighbouring profiles, which overlapping
speckle has.

The kernel is piecewise linear between lags of the grid of the measurement, so that h * h on that
grid is the discrete autocorrelation of its values, filtered by the cubic B-spline's 1/6, 2/3, 1/6:
its values are the root of the measured spectrum over that of the spline.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.special import eval_hermitenorm

from sensors.noise.heights import HeightMap
from sensors.noise.splitmix64 import mixed

Floats = NDArray[np.float64]
Table = tuple[tuple[float, ...], ...]

LAGS = 8
"""Largest measured lag, in steps of the grid, along each axis."""

FFT = 64
"""Lags of the grid on which the root of the spectrum is taken: the kernel fades well within."""

ENERGY = 0.999
"""Share of the kernel's energy that is kept; tails beyond are of the measurement's own error."""

OVERLAP = 6
"""Impulses, at least, whose kernels overlap at a point: their sum is nearly Gaussian."""

HERMITE = 24
"""Terms of the expansion of a map of heights (Mehler's formula)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MeasuredField:
    """A law of random height fields whose autocorrelation was measured; `sample` draws one.

    Parameters
    ----------
    amplitude_mm : float
        Standard deviation; with `heights`, factor on the map.
    cell_x_mm, cell_y_mm : float
        Steps of the grid on which the autocorrelation was measured, along the line and the travel.
    correlation : (2a + 1, 2b + 1) table
        Autocorrelation, 1 in the middle; rows are lags along the travel.
    heights : HeightMap, optional
        Monotone map from the standardised field to heights.
    """

    amplitude_mm: float
    cell_x_mm: float
    cell_y_mm: float
    correlation: Table
    heights: HeightMap | None = None

    def __post_init__(self) -> None:
        if not (self.cell_x_mm > 0.0 and self.cell_y_mm > 0.0):
            raise ValueError("the steps of the grid must be positive")
        widths = {len(row) for row in self.correlation}
        if len(self.correlation) % 2 == 0 or len(widths) != 1 or widths.pop() % 2 == 0:
            raise ValueError("the correlation needs an odd number of rows, equal and odd in length")

    def moments_mm(self, _pitch_x_mm: float = 0.0, _pitch_y_mm: float = 0.0) -> tuple[float, float]:
        """Return mean and standard deviation, mm; the same on every grid."""
        if self.heights is None:
            return 0.0, self.amplitude_mm
        terms = _hermite(self.heights)
        sd = math.sqrt(float(np.sum(terms[1:] ** 2)))
        return self.amplitude_mm * float(terms[0]), self.amplitude_mm * sd

    def sample(
        self, x_mm: Floats, y_mm: Floats, rng: np.random.Generator, *,
        lay_ratio: float = 1.0, lay_angle_rad: float = 0.0,
    ) -> Floats:  # fmt: skip
        """Draw one field on the grid of rows y and columns x.

        Equal positions have equal heights whatever the grid around them.

        Parameters
        ----------
        x_mm : (m,) array
            Positions of the columns along the line, mm.
        y_mm : (n,) array
            Positions of the rows along the travel, mm.
        rng : Generator
            Source of one key and of the lattice's shift.
        lay_ratio, lay_angle_rad
            Stretch along a direction, see `sensors.noise.lay.sample_lay`.

        Returns
        -------
        (n, m) array
            Heights in mm.
        """
        key = rng.integers(0, 2**64, dtype=np.uint64)
        shift = rng.random(2)
        kernel, impulses = _spread(self.correlation)
        out = np.empty((len(y_mm), len(x_mm)))
        _add(
            out, kernel, impulses, key, self._turn(lay_ratio, lay_angle_rad), shift,
            np.ascontiguousarray(x_mm, np.float64), np.ascontiguousarray(y_mm, np.float64),
        )  # fmt: skip
        if self.heights is not None:
            self.heights.apply(out, self.amplitude_mm)
        else:
            out *= self.amplitude_mm
        return out

    def correlation_at(
        self, x_mm: Floats, y_mm: Floats, *, lay_ratio: float = 1.0, lay_angle_rad: float = 0.0
    ) -> Floats:
        """Autocorrelation of the heights at lags, (rows y, columns x): 1 at lag 0."""
        kernel, impulses = _spread(self.correlation)
        own = _autocorrelation(kernel) * impulses
        turn = self._turn(lay_ratio, lay_angle_rad)
        u = turn[0, 0] * x_mm + turn[0, 1] * np.asarray(y_mm)[:, None]
        v = turn[1, 0] * x_mm + turn[1, 1] * np.asarray(y_mm)[:, None]
        half_v, half_u = (size // 2 for size in own.shape)
        rho = map_coordinates(
            np.pad(own, 2), [v + half_v + 2, u + half_u + 2], order=3, prefilter=False,
            mode="constant",
        )  # fmt: skip
        return np.asarray(rho if self.heights is None else mapped(rho, self.heights))

    @property
    def reach_mm(self) -> tuple[float, float]:
        """Largest lag at which points are correlated, along the line and along the travel, mm."""
        rows, columns = _spread(self.correlation)[0].shape
        return (columns + 1) * self.cell_x_mm, (rows + 1) * self.cell_y_mm

    def _turn(self, ratio: float, angle_rad: float) -> Floats:
        stretch = math.sqrt(ratio)
        cosine, sine = (math.cos(angle_rad), math.sin(angle_rad)) if ratio != 1.0 else (1.0, 0.0)
        along, across = self.cell_x_mm * stretch, self.cell_y_mm / stretch
        return np.array([[cosine / along, sine / along], [-sine / across, cosine / across]])


def standardised(correlation: Floats, heights: HeightMap) -> Floats:
    """Return the correlation before a map of heights that becomes `correlation` behind it."""
    before = np.linspace(-1.0, 1.0, 2001)
    behind = mapped(before, heights)
    return np.asarray(np.interp(correlation, behind, before))


def mapped(correlation: Floats, heights: HeightMap) -> Floats:
    """Return the correlation behind a map of heights (Mehler): Σ a_k² ρ^k over Σ a_k²."""
    squares = _hermite(heights)[1:] ** 2
    powers = np.asarray(correlation)[..., None] ** np.arange(1, squares.size + 1)
    return np.asarray((powers @ squares) / squares.sum())


@functools.lru_cache(maxsize=64)
def _hermite(heights: HeightMap) -> Floats:
    """Coefficients of a map of heights in normalised Hermite polynomials; the first is its mean."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(120)
    values = heights(nodes) * weights / weights.sum()
    order = np.arange(HERMITE + 1)
    polynomials = eval_hermitenorm(order[:, None], nodes)
    factorials = np.array([math.sqrt(math.factorial(k)) for k in order])
    return np.asarray((polynomials / factorials[:, None]) @ values)


@functools.lru_cache(maxsize=64)
def _spread(correlation: Table) -> tuple[Floats, int]:
    """Kernel's values at lags of the grid, and impulses in a cell; the field's variance is 1."""
    table = np.array(correlation)
    half = [size // 2 for size in table.shape]
    full = np.zeros((FFT, FFT))
    for i, row in enumerate(table):
        for j, value in enumerate(row):
            full[i - half[0], j - half[1]] = value
    wave = 2.0 * np.pi * np.fft.fftfreq(FFT)
    spline = 2.0 / 3.0 + np.cos(wave) / 3.0
    spectrum = np.maximum(np.fft.fft2(full).real, 0.0) / np.outer(spline, spline)
    values = np.fft.fftshift(np.fft.ifft2(np.sqrt(spectrum)).real)
    middle = FFT // 2
    reach = 1
    while (
        reach < middle - 1
        and np.sum(values[middle - reach : middle + reach + 1,
                          middle - reach : middle + reach + 1] ** 2)
        < ENERGY * np.sum(values**2)
    ):  # fmt: skip
        reach += 1
    kernel = values[middle - reach : middle + reach + 1, middle - reach : middle + reach + 1]
    effective = float(np.sum(kernel**2) ** 2 / np.sum(kernel**4))  # cells
    impulses = max(1, math.ceil(OVERLAP / effective))
    three = np.array([1.0, 4.0, 1.0]) / 6.0
    own = _autocorrelation(kernel)
    at = tuple(size // 2 for size in own.shape)
    variance = sum(
        three[a + 1] * three[b + 1] * own[at[0] + a, at[1] + b]
        for a in (-1, 0, 1) for b in (-1, 0, 1)
    )  # fmt: skip
    return np.ascontiguousarray(kernel / math.sqrt(impulses * variance)), impulses


def _autocorrelation(kernel: Floats) -> Floats:
    """Sum the products of a kernel's values at all lags."""
    shape = [2 * size - 1 for size in kernel.shape]
    power = np.abs(np.fft.fft2(kernel, shape)) ** 2
    return np.asarray(np.fft.fftshift(np.fft.ifft2(power).real))


@njit(cache=True)
def _add(
    out: Floats, kernel: Floats, impulses: int, key: np.uint64, turn: Floats, shift: Floats,
    x_mm: Floats, y_mm: Floats,
) -> None:  # fmt: skip
    """Fill `out` with the sum of all impulses near each point."""
    half_v, half_u = kernel.shape[0] // 2, kernel.shape[1] // 2
    scale = 1.0 / 2147483648.0
    for i in range(y_mm.size):
        for j in range(x_mm.size):
            u = turn[0, 0] * x_mm[j] + turn[0, 1] * y_mm[i] + shift[0]
            v = turn[1, 0] * x_mm[j] + turn[1, 1] * y_mm[i] + shift[1]
            column, row = int(math.floor(u)), int(math.floor(v))
            total = 0.0
            for r in range(row - half_v - 2, row + half_v + 2):
                row_key = mixed(key + np.uint64(r) * np.uint64(0x9E3779B97F4A7C15))
                for c in range(column - half_u - 2, column + half_u + 2):
                    h = mixed(row_key + np.uint64(c) * np.uint64(0xD1342543DE82EF95))
                    for _ in range(impulses):
                        du = u - c - (h & np.uint64(0x7FFFFFFF)) * scale + half_u
                        dv = v - r - ((h >> np.uint64(31)) & np.uint64(0x7FFFFFFF)) * scale + half_v
                        sign = 1.0 if (h >> np.uint64(63)) == np.uint64(0) else -1.0
                        h = mixed(h + np.uint64(0x9E3779B97F4A7C15))
                        a, b = int(math.floor(du)), int(math.floor(dv))
                        if a < -1 or b < -1 or a > 2 * half_u or b > 2 * half_v:
                            continue
                        du -= a
                        dv -= b
                        value = 0.0
                        if b >= 0:
                            if a >= 0:
                                value += (1.0 - du) * (1.0 - dv) * kernel[b, a]
                            if a < 2 * half_u:
                                value += du * (1.0 - dv) * kernel[b, a + 1]
                        if b < 2 * half_v:
                            if a >= 0:
                                value += (1.0 - du) * dv * kernel[b + 1, a]
                            if a < 2 * half_u:
                                value += du * dv * kernel[b + 1, a + 1]
                        total += sign * value
            out[i, j] = total
