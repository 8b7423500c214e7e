"""Perlin noise drawn out along a direction: the lay of ground, rolled or milled surfaces.

The same octaves as `sensors.noise.perlin`, but on a lattice that is turned and stretched, so that
the grid of the scan is no longer separable in it and each point is looked up on its own.
"""

import dataclasses
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.noise.measured_field import MeasuredField
from sensors.noise.perlin import grid_pitch
from sensors.noise.speckle import Speckle
from sensors.noise.splitmix64 import mixed

Floats = NDArray[np.float64]


def sample_lay(
    field: Speckle,
    x_mm: Floats,
    y_mm: Floats,
    ratio: float,
    angle_rad: float,
    rng: np.random.Generator,
) -> Floats:
    """Draw a field whose control points stand √ratio farther apart along `angle_rad`.

    Parameters
    ----------
    field : Speckle
        The noise without lay; with equal cells the result's spectrum is an ellipse.
    x_mm : (m,) array
        Columns, mm.
    y_mm : (n,) array
        Rows, mm.
    ratio : float
        Length along the lay over length across it.
    angle_rad : float
        Direction of the lay from x towards y.
    rng : Generator

    Returns
    -------
    (n, m) array
        Heights in mm.
    """
    if isinstance(field, MeasuredField):
        return field.sample(x_mm, y_mm, rng, lay_ratio=ratio, lay_angle_rad=angle_rad)
    stretch = math.sqrt(ratio)
    drawn = dataclasses.replace(
        field, cell_x_mm=field.cell_x_mm * stretch, cell_y_mm=field.cell_y_mm / stretch
    )
    keys = rng.integers(0, 2**64, size=field.octaves, dtype=np.uint64)
    shifts = rng.random((field.octaves, 2))
    pitch = grid_pitch(np.asarray(x_mm)), grid_pitch(np.asarray(y_mm))
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    along = math.hypot(pitch[0] * cosine, pitch[1] * sine)
    across = math.hypot(pitch[0] * sine, pitch[1] * cosine)
    scale = field.amplitude_mm if field.heights is None else 1.0 / drawn.sd(along, across)
    out = np.zeros((len(y_mm), len(x_mm)))
    for m, (gain, cell_along, cell_across) in enumerate(drawn.drawn_octaves(along, across)):
        turn = np.array([[cosine / cell_along, sine / cell_along],
                         [-sine / cell_across, cosine / cell_across]])  # fmt: skip
        _add_turned(out, scale * gain, keys[m], turn, shifts[m], x_mm, y_mm)
    if field.heights is not None:
        field.heights.apply(out, field.amplitude_mm)
    return out


@njit(cache=True)
def _corner(key: np.uint64, row: int, column: int, dx: float, dy: float) -> float:
    """Dot product of a control point's unit gradient with the way from it (equation 4)."""
    h = mixed(key + np.uint64(row) * np.uint64(0x9E3779B97F4A7C15))
    h = mixed(h + np.uint64(column) * np.uint64(0xD1342543DE82EF95))
    angle = (h >> np.uint64(11)) * (2.0 * math.pi / 9007199254740992.0)
    return math.cos(angle) * dx + math.sin(angle) * dy


@njit(cache=True)
def _fade(t: float) -> float:
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)


@njit(cache=True)
def _add_turned(
    out: Floats,
    gain: float,
    key: np.uint64,
    turn: Floats,
    shift: Floats,
    x_mm: Floats,
    y_mm: Floats,
) -> None:
    for i in range(y_mm.size):
        for j in range(x_mm.size):
            u = turn[0, 0] * x_mm[j] + turn[0, 1] * y_mm[i] + shift[0]
            v = turn[1, 0] * x_mm[j] + turn[1, 1] * y_mm[i] + shift[1]
            column, row = int(math.floor(u)), int(math.floor(v))
            du, dv = u - column, v - row
            low = _corner(key, row, column, du, dv)
            low += _fade(du) * (_corner(key, row, column + 1, du - 1.0, dv) - low)
            high = _corner(key, row + 1, column, du, dv - 1.0)
            high += _fade(du) * (_corner(key, row + 1, column + 1, du - 1.0, dv - 1.0) - high)
            out[i, j] += gain * (low + _fade(dv) * (high - low))
