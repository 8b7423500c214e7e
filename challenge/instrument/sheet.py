"""The laser sheet: a Gaussian beam across, spread evenly in angle along the line."""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, slots=True)
class LaserSheet:
    """Irradiance across the sheet.

    Attributes
    ----------
    waist_mm
        Standard deviation of the irradiance across the sheet at its waist (a quarter of
        the 1/e² full width).
    waist_z_mm
        Depth of the waist in the sensor frame.
    wavelength_mm, m_squared
        Wavelength and beam quality: they set how fast the sheet diverges.
    exposure_s
        Time the shutter stays open for one profile.
    """

    waist_mm: float
    waist_z_mm: float
    wavelength_mm: float = 405e-6
    m_squared: float = 1.2
    exposure_s: float = 2e-4

    @property
    def rayleigh_mm(self) -> float:
        """Depth over which the sheet widens by √2 (w = 2 s)."""
        return pi * (2 * self.waist_mm) ** 2 / (self.m_squared * self.wavelength_mm)

    def sigma_mm(self, depth_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the standard deviation of the irradiance across the sheet at a depth.

        Parameters
        ----------
        depth_mm : any shape
            Depth in the sensor frame.

        Returns
        -------
        same shape, mm
        """
        off = (np.asarray(depth_mm) - self.waist_z_mm) / self.rayleigh_mm
        return self.waist_mm * np.sqrt(1 + off**2)
