"""The sensor's own uncertainty: resolution and repeatability (equation 10), and rounding."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Resolution(Protocol):
    """What equation 10 needs of a datasheet."""

    @property
    def z_resolution_um(self) -> float | None:
        """Resolution in depth ΔZ, µm."""

    @property
    def repeatability_um(self) -> float | None:
        """Standard deviation of repeated readings, µm."""


def sigma_mm(datasheet: Resolution) -> float:
    """Return the standard deviation of a reading before rounding, mm.

    σ = sqrt(ΔZ² / 12 + σ_rep²) (Sensors 2023, 23, 7624, equation 10): a uniform error of the
    resolution's width and the repeatability, taken together as one Gaussian. A figure that the
    datasheet leaves out counts as zero.
    """
    return gaussian_sd_mm(
        (datasheet.z_resolution_um or 0.0) / 1000.0, (datasheet.repeatability_um or 0.0) / 1000.0
    )


def gaussian_sd_mm(resolution_mm: float, repeatability_mm: float = 0.0) -> float:
    """Equation 10 from its two figures, mm."""
    return math.hypot(resolution_mm / math.sqrt(12.0), repeatability_mm)


def quantise(depth_mm: Floats, step_mm: float, out: Floats | None = None) -> Floats:
    """Round readings to the nearest multiple of ΔZ, halves to even; NaN stays NaN.

    Parameters
    ----------
    depth_mm : array
        Readings, mm.
    step_mm : float
        ΔZ in mm; 0 leaves the readings as they are.
    out : array, optional
        Where the rounded readings go; `depth_mm` itself is allowed.

    Notes
    -----
    The paper speaks of trimming. Cutting down would shift every reading by half a step; rounding
    has no such bias.
    """
    if step_mm == 0.0:
        return depth_mm
    counts: Floats = np.rint(np.divide(depth_mm, step_mm, out=out), out=out)
    return np.multiply(counts, step_mm, out=out)
