"""What stands in the light's way: scratched and skew windows, their reflections, hot air."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
MODES = 400
"""Waves that a field of hot air is the sum of."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Window:
    """The instrument's windows, as they have become since its calibration.

    Attributes
    ----------
    scratch_rows, scratch_mm, scratch_at_mm, scratch_slant, scratch_loss
        Of a scratch across the camera's window: deflection of sight lines, width, place along the
        line at the middle row, mm of x for each mm of image, share of light lost in its middle.
    ghost, ghost_mm
        Second reflection of the sheet in its own window: irradiance against the sheet, and how far
        beside it.
    skew_rows
        Shear of a window that was knocked askew: rows for each mm of x and mm of image.
    """

    scratch_rows: float = 0.0
    scratch_mm: float = 0.4
    scratch_at_mm: float = 0.0
    scratch_slant: float = 1.0
    scratch_loss: float = 0.0
    ghost: float = 0.0
    ghost_mm: float = 0.25
    skew_rows: float = 0.0

    def seen(self, x_mm: Floats, image_mm: Floats) -> tuple[Floats, Floats]:
        """Deflection in rows, and transmission, of sight lines.

        A groove is a prism of either sign on its two flanks: the derivative of a Gaussian.

        Parameters
        ----------
        x_mm, image_mm : place along the line, and across the axis from the middle row
        """
        u = (x_mm - self.scratch_at_mm - self.scratch_slant * image_mm) / self.scratch_mm
        dip = np.exp(-0.5 * u**2)
        bent = self.scratch_rows * u * dip * np.exp(0.5) + self.skew_rows * x_mm * image_mm
        return np.asarray(bent), 1 - self.scratch_loss * dip


@dataclass(frozen=True, kw_only=True, slots=True)
class Air:
    """Hot air: sight lines wander with the gradient of a frozen, drifting Kolmogorov phase.

    Roddier, Progress in Optics 19 (1981) 281: the phase's spectrum falls as k^(-11/3), that of its
    gradient, the angle of arrival, as k^(-5/3); Taylor's hypothesis carries it with the wind.

    Attributes
    ----------
    shift_mm
        Standard deviation of the image, as displacement on the part.
    outer_mm, inner_mm
        Scales between which the spectrum is Kolmogorov's.
    wind_mm_s
        Along the line.
    """

    shift_mm: float = 0.0
    outer_mm: float = 20.0
    inner_mm: float = 1.0
    wind_mm_s: float = 60.0

    def shifts(self, x_mm: Floats, time_s: Floats, rng: np.random.Generator) -> Floats:
        """Shift (n, m) of the image in mm on the part, at columns and times."""
        if self.shift_mm == 0:
            return np.zeros((time_s.size, x_mm.size))
        at = (x_mm - self.wind_mm_s * time_s[:, None]).ravel()
        wave, phase = self.waves(rng), rng.uniform(0, 2 * np.pi, MODES)
        total = np.zeros(at.size)
        for k, p in zip(wave, phase, strict=True):
            total += np.cos(k * at + p)
        return np.asarray(self.shift_mm * np.sqrt(2 / MODES) * total.reshape(time_s.size, -1))

    def waves(self, rng: np.random.Generator) -> Floats:
        """Wave numbers along x, rad/mm, of a field whose plane spectrum is k^(-5/3).

        In the plane the density of k is k · k^(-5/3) = k^(-2/3) between the scales.
        """
        low, high = 2 * np.pi / self.outer_mm, 2 * np.pi / self.inner_mm
        u = rng.uniform(0, 1, MODES)
        k = (low ** (1 / 3) + u * (high ** (1 / 3) - low ** (1 / 3))) ** 3
        return np.asarray(k * np.cos(rng.uniform(0, 2 * np.pi, MODES)))
