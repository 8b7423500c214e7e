"""Closed forms of an octave of Perlin noise: its power spectrum and its largest value."""

import math

import numpy as np
from numpy.typing import NDArray

from sensors.noise.perlin import BUMP_ENERGY, RAMP_ENERGY, smoothstep

Floats = NDArray[np.float64]

OCTAVE_MAX = math.sqrt(0.5)
"""Largest value of one octave: all four gradients of a cell pointing to its middle."""


def octave_spectrum(fx: Floats, fy: Floats) -> Floats:
    """Two-sided power spectral density of one octave of unit cell, closed form up to quadrature.

    With unit gradients of uniform direction the field is the sum over control points of
    gx·ramp(x)·bump(y) + gy·bump(x)·ramp(y), bump w(t) = 1 - smoothstep(|t|), ramp t·w(t), so that
    S(fx, fy) = ½ (|R(fx)|²|B(fy)|² + |B(fx)|²|R(fy)|²), R and B their Fourier transforms.

    Parameters
    ----------
    fx, fy : arrays that broadcast
        Frequencies in cycles a cell.
    """
    bump_x, ramp_x = _transforms(fx)
    bump_y, ramp_y = _transforms(fy)
    return 0.5 * (ramp_x * bump_y + bump_x * ramp_y)


def octave_line_spectrum(f: Floats) -> Floats:
    """Two-sided power spectral density of one octave along a line parallel to an axis."""
    bump, ramp = _transforms(f)
    return 0.5 * (ramp * BUMP_ENERGY + bump * RAMP_ENERGY)


def _transforms(f: Floats) -> tuple[Floats, Floats]:
    """Return |B|² and |R|² at frequency f (cycles a cell) by Gauss-Legendre quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(96)
    t = 0.5 * (nodes + 1.0)
    w = 0.5 * weights * (1.0 - smoothstep(t))
    phase = 2.0 * np.pi * np.asarray(f, dtype=np.float64)[..., None] * t
    bump = 2.0 * np.sum(w * np.cos(phase), axis=-1)
    ramp = 2.0 * np.sum(w * t * np.sin(phase), axis=-1)
    return bump * bump, ramp * ramp
