"""Perlin gradient noise on a separable grid, in millimetres (equations 3 to 9 of the paper).

Sensors 2023, 23, 7624, section 2.2.1: octaves of a lattice gradient noise with unit gradients at
control points and the quintic smoothstep between them. Three things are added to the text:

- every octave's lattice is shifted by a random part of a cell (unless `aligned`), since lattices
  that share their origin are zero together at every control point of the first octave;
- control points closer than the grid can show are spread to its limit, and octaves that add
  nothing new by then are left out (unless `band_limited` is off): sampled anyway, they would
  beat against the profiles. Across an axis at its limit, a row's place between the control
  points is kept from changing its variance, which would show as stripes;
- the sum can be standardised by its own, exactly known standard deviation and bent by a monotone
  map of the heights.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.noise.heights import HeightMap
from sensors.noise.splitmix64 import mixed

Floats = NDArray[np.float64]

GRID_LIMIT = 1.2
"""Closest control points in grid steps.

The spectrum of an octave is highest at about 0.56 cycles a cell (the transform of t·w(t)); at 1.2
grid steps a cell that is 0.47 cycles a step, just below Nyquist's 0.5.
"""

BUMP_ENERGY = 181.0 / 231.0
"""Integral of w² over -1..1, w(t) = 1 - smoothstep(|t|)."""

RAMP_ENERGY = 535.0 / 9009.0
"""Integral of (t·w)² over -1..1."""

OCTAVE_SD = math.sqrt(BUMP_ENERGY * RAMP_ENERGY)
"""Standard deviation of one octave with unit gradients, averaged over the cell (about 0.216)."""


def smoothstep(t: Floats) -> Floats:
    """Quintic fade 6t⁵ - 15t⁴ + 10t³, clamped to 0..1 (equation 8)."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class PerlinField:
    """A law of random height fields; `sample` draws one.

    Parameters
    ----------
    amplitude_mm : float
        Factor on the sum of the octaves (A of equation 9); with `heights`, factor on the map.
    cell_x_mm, cell_y_mm : float
        Distance of the first octave's control points along the line and along the travel, mm.
    octaves : int
        Octaves wanted, each with half the cell of the one before.
    persistence : float
        Amplitude of an octave relative to the one before.
    heights : HeightMap, optional
        Monotone map from the standardised sum (zero mean, unit variance) to heights. Without one
        the sum of the octaves is used as it stands.
    aligned : bool
        All octaves share the origin of the grid as a control point, as the paper states.
    band_limited : bool
        Omit octaves beyond the grid's limit; False shows the aliasing.
    """

    amplitude_mm: float
    cell_x_mm: float
    cell_y_mm: float
    octaves: int = 4
    persistence: float = 0.5
    heights: HeightMap | None = None
    aligned: bool = False
    band_limited: bool = True

    def __post_init__(self) -> None:
        if not (self.cell_x_mm > 0.0 and self.cell_y_mm > 0.0):
            raise ValueError("the distance of control points must be positive")
        if self.octaves < 1 or not 0.0 <= self.persistence <= 1.0:
            raise ValueError("at least one octave, persistence from 0 to 1")

    def drawn_octaves(
        self, pitch_x_mm: float = 0.0, pitch_y_mm: float = 0.0
    ) -> list[tuple[float, float, float]]:
        """Gain, cell_x_mm and cell_y_mm of each octave as drawn on a grid of this pitch.

        Along each axis on its own, control points stand at least `GRID_LIMIT` steps apart; an
        octave that this makes a copy of the one before is left out. The first is always drawn.
        """
        limit_x = GRID_LIMIT * pitch_x_mm if self.band_limited else 0.0
        limit_y = GRID_LIMIT * pitch_y_mm if self.band_limited else 0.0
        octaves: list[tuple[float, float, float]] = []
        for m in range(self.octaves):
            cells = (max(self.cell_x_mm / 2**m, limit_x), max(self.cell_y_mm / 2**m, limit_y))
            if not octaves or cells != octaves[-1][1:]:
                octaves.append((self.persistence**m, *cells))
        return octaves

    def sd(self, pitch_x_mm: float = 0.0, pitch_y_mm: float = 0.0) -> float:
        """Return the standard deviation of the octaves' sum before amplitude and heights."""
        gains = [gain for gain, _, _ in self.drawn_octaves(pitch_x_mm, pitch_y_mm)]
        return OCTAVE_SD * math.sqrt(sum(gain * gain for gain in gains))

    def moments_mm(self, pitch_x_mm: float, pitch_y_mm: float) -> tuple[float, float]:
        """Return mean and standard deviation on a grid of these steps, mm."""
        if self.heights is None:
            return 0.0, self.amplitude_mm * self.sd(pitch_x_mm, pitch_y_mm)
        nodes, weights = _normal_nodes()
        heights = self.amplitude_mm * self.heights(nodes)
        weights = weights / weights.sum()
        mean = weights @ heights
        return float(mean), float(np.sqrt(weights @ (heights - mean) ** 2))

    def sample(self, x_mm: Floats, y_mm: Floats, rng: np.random.Generator) -> Floats:
        """Draw one field on the grid of rows y and columns x.

        Parameters
        ----------
        x_mm : (m,) array
            Positions of the columns along the line, mm; evenly spaced or not.
        y_mm : (n,) array
            Positions of the rows along the travel, mm, in any order.
        rng : Generator
            Source of the gradients and the lattices' shifts. The number of draws depends only on
            `octaves`, and equal positions have equal heights whatever the grid around them
            (as long as the same octaves are drawn).

        Returns
        -------
        (n, m) array
            Heights in mm.
        """
        return np.asarray(self.samples(x_mm, y_mm, rng, 1)[0])

    def samples(
        self, x_mm: Floats, y_mm: Floats, rng: np.random.Generator, count: int
    ) -> Floats:
        """Draw `count` fields one after another; (count, n, m), the same as of `sample`.

        Parameters are those of `sample`.
        """
        x_mm = np.ascontiguousarray(x_mm, dtype=np.float64)
        y_mm = np.ascontiguousarray(y_mm, dtype=np.float64)
        keys = np.empty((count, self.octaves), dtype=np.uint64)
        shifts = np.empty((count, self.octaves, 2))
        for k in range(count):
            keys[k] = rng.integers(0, 2**64, size=self.octaves, dtype=np.uint64)
            shifts[k] = rng.random((self.octaves, 2))
        if self.aligned:
            shifts[:] = 0.0
        pitch_x_mm, pitch_y_mm = grid_pitch(x_mm), grid_pitch(y_mm)
        octaves = self.drawn_octaves(pitch_x_mm, pitch_y_mm)
        scale = self.amplitude_mm
        if self.heights is not None:
            scale = 1.0 / self.sd(pitch_x_mm, pitch_y_mm)
        out = np.zeros((count, y_mm.size, x_mm.size))
        for m, (gain, cell_x_mm, cell_y_mm) in enumerate(octaves):
            column, x = _lattice(x_mm / cell_x_mm + shifts[:, m, :1])
            row, y = _lattice(y_mm / cell_y_mm + shifts[:, m, 1:])
            gain_x = _even(x, cell_x_mm > self.cell_x_mm / 2**m)
            gain_y = scale * gain * _even(y, cell_y_mm > self.cell_y_mm / 2**m)
            fade_x, fade_y = smoothstep(x), smoothstep(y)
            first, last = column.min(axis=1).tolist(), column.max(axis=1).tolist()
            for k in range(count):
                columns, left = _control_points(column[k], first[k], last[k])
                _add_octave(
                    out[k], gain_x[k], gain_y[k], keys[k, m], columns, left,
                    x[k], fade_x[k], row[k], y[k], fade_y[k],
                )  # fmt: skip
        if self.heights is not None:
            self.heights.apply(out, self.amplitude_mm)
        return out


@functools.cache
def _normal_nodes() -> tuple[Floats, Floats]:
    """Return nodes and weights of Gauss-Hermite quadrature over a standard normal variable."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    return nodes, weights


def grid_pitch(positions_mm: Floats) -> float:
    """Typical step between neighbouring positions, mm; 0 for a single one."""
    if positions_mm.size < 2:
        return 0.0
    return float(np.median(np.abs(np.diff(positions_mm))))


def _lattice(cells: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Split positions in cells into the control point below and the rest."""
    below = np.floor(cells)
    return below.astype(np.int64), cells - below


def _control_points(
    column: NDArray[np.int64], first: int, last: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """List the columns of control points on both sides of each place, and each place's left one."""
    if last - first < 2 * column.size:
        return np.arange(first, last + 2), column - first
    columns = np.unique(np.concatenate((column, column + 1)))
    return columns, np.searchsorted(columns, column)


def _even(place: Floats, limited: bool) -> Floats:
    """Gain of rows (or columns) at a place in the cell that gives all the same variance.

    A row at y has the variance ½ (R Σw² + B Σw²d²), w and d weight and distance of the control
    points on both sides, R and B the energies of ramp and bump along the row.
    """
    if not limited:
        return np.ones_like(place)
    near, far = (1.0 - smoothstep(place)) ** 2, smoothstep(place) ** 2
    variance = 0.5 * RAMP_ENERGY * (near + far)
    variance += 0.5 * BUMP_ENERGY * (near * place**2 + far * (1.0 - place) ** 2)
    return np.asarray(OCTAVE_SD / np.sqrt(variance))


TWO_43 = 2.0**43
TURN = math.pi / 4.0 / TWO_43
C0, C1, C2, C3, C4, C5, C6, C7 = ((-1.0) ** k / math.factorial(2 * k) for k in range(8))
S0, S1, S2, S3, S4, S5, S6 = ((-1.0) ** k / math.factorial(2 * k + 1) for k in range(7))


@njit(cache=True)
def gradients(
    key: np.uint64, row: int, columns: NDArray[np.int64], gx: Floats, gy: Floats
) -> None:
    """Draw unit gradients, uniform in direction, of one row of control points."""
    row_key = mixed(key + np.uint64(row) * np.uint64(0x9E3779B97F4A7C15))
    for k in range(columns.size):
        h = mixed(row_key + np.uint64(columns[k]) * np.uint64(0xD1342543DE82EF95))
        # the upper two bits choose the quadrant, the rest an angle of -pi/4 to pi/4 in it
        t = (np.float64((h >> np.uint64(10)) & np.uint64(0xFFFFFFFFFFF)) - TWO_43) * TURN
        s = t * t
        cosine = C0 + s * (C1 + s * (C2 + s * (C3 + s * (C4 + s * (C5 + s * (C6 + s * C7))))))
        sine = t * (S0 + s * (S1 + s * (S2 + s * (S3 + s * (S4 + s * (S5 + s * S6))))))
        sign = 1.0 if (h >> np.uint64(63)) == np.uint64(0) else -1.0
        swap = ((h >> np.uint64(62)) & np.uint64(1)) == np.uint64(1)
        gx[k] = sign * (-sine if swap else cosine)
        gy[k] = sign * (cosine if swap else sine)


@njit(cache=True)
def _add_octave(
    out: Floats,
    gain_x: Floats,
    gain_y: Floats,
    key: np.uint64,
    columns: NDArray[np.int64],
    left: NDArray[np.int64],
    x: Floats,
    fade_x: Floats,
    row: NDArray[np.int64],
    y: Floats,
    fade_y: Floats,
) -> None:
    """Add one octave (equations 4 to 8) times its gains, blended along y first, then along x."""
    size = columns.size
    gx0, gy0, gx1, gy1 = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    slope, level = np.empty(size), np.empty(size)
    have = False
    held = np.int64(0)
    for i in range(row.size):
        if not have or row[i] != held:
            if have and row[i] == held + 1:
                gx0, gx1 = gx1, gx0
                gy0, gy1 = gy1, gy0
            else:
                gradients(key, row[i], columns, gx0, gy0)
            gradients(key, row[i] + 1, columns, gx1, gy1)
            held = row[i]
            have = True
        yi, fade, gain = y[i], fade_y[i], gain_y[i]
        for k in range(size):
            slope[k] = gain * (gx0[k] + fade * (gx1[k] - gx0[k]))
            below = gy0[k] * yi
            level[k] = gain * (below + fade * (gy1[k] * (yi - 1.0) - below))
        for j in range(x.size):
            k = left[j]
            near = slope[k] * x[j] + level[k]
            far = slope[k + 1] * (x[j] - 1.0) + level[k + 1]
            out[i, j] += gain_x[j] * (near + fade_x[j] * (far - near))
