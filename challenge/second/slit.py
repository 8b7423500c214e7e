"""Light across the line: a slit lit by an LED, imaged by a lens of finite aperture.

Goodman, Introduction to Fourier Optics, chapter 6: coherent light images the slit's amplitude with
sinc, incoherent light its intensity with sinc²; partly coherent light is taken as a mixture.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import sici

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Slit:
    """Irradiance across the line.

    Attributes
    ----------
    width_mm
        Geometric width of the slit's image.
    blur_mm
        First zero of the lens's amplitude spread: wavelength over full aperture angle.
    coherence
        0 incoherent to 1 coherent: the share imaged by amplitude, with side lobes.
    """

    width_mm: float
    blur_mm: float
    coherence: float

    @property
    def reach_mm(self) -> float:
        """Where the irradiance has fallen below about a hundredth, side lobes included."""
        return self.width_mm / 2 + 4 * self.blur_mm

    def irradiance(self, eta_mm: Floats) -> Floats:
        """Irradiance at a distance from the line's middle; 1 in the middle of a wide slit.

        Parameters
        ----------
        eta_mm : any shape
        """
        right = (np.asarray(eta_mm) + self.width_mm / 2) / self.blur_mm
        left = (np.asarray(eta_mm) - self.width_mm / 2) / self.blur_mm
        amplitude = (sici(np.pi * right)[0] - sici(np.pi * left)[0]) / np.pi
        return np.asarray(
            self.coherence * amplitude**2
            + (1 - self.coherence) * (_sinc2_integral(right) - _sinc2_integral(left))
        )


def _sinc2_integral(u: Floats) -> Floats:
    """∫ sinc²(t) dt from 0 to u: Si(2πu)/π - sin²(πu)/(π²u)."""
    safe = np.where(u == 0, 1.0, u)
    return np.asarray(
        np.where(u == 0, 0.0, sici(2 * np.pi * u)[0] / np.pi
                 - np.sin(np.pi * u) ** 2 / (np.pi**2 * safe))
    )  # fmt: skip
