"""How shallow a pit each pass still shows: a matched filter at the pass's pitch and incidence."""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.passes.straight_passes import STEEPEST_DEG, Pass
from pipeline.scan.detectability import noise_power
from sensors.datasheet import Datasheet
from sensors.noise.correlation import speckle_kernel
from sensors.noise.uncertainty import sigma_mm
from sensors.surface.surface import Surface

Floats = NDArray[np.float64]

PIT_MM: Final = 2.0
"""Diameter of the reference pit."""

DETECTED_AT: Final = 5.0
"""Signal-to-noise ratio of a detection (Rose, Adv. Electron. Electron Phys. 1 (1948) 131)."""

NODES: Final = 6  # incidences between which the depth is interpolated
LATTICE: Final = 5  # places of the pit on the grid along each axis, averaged over


@dataclass(frozen=True, kw_only=True, slots=True)
class ReferencePit:
    """A pit of parabolic section, to be found among one sensor's noise on one surface.

    Attributes
    ----------
    datasheet
        Steps along the line, white noise and rounding.
    surface
        Roughness; None: a smooth part.
    profiles : int
        Of a pass, evenly spaced over its length.
    """

    datasheet: Datasheet
    surface: Surface | None
    profiles: int
    _known: dict[float, Floats] = field(default_factory=dict)

    def depths_mm(self, one: Pass) -> Floats:
        """Return the smallest depth found at each sample of a pass, mm; infinite where not seen."""
        pitch = one.length_mm / (self.profiles - 1)
        angles = np.linspace(0, STEEPEST_DEG, NODES)
        key = round(pitch, 4)
        if key not in self._known:
            self._known[key] = self._at(pitch, np.radians(angles))
        incidence = np.degrees(np.arccos(np.clip(one.cosine, 0, 1)))
        return np.where(one.seen, np.interp(incidence, angles, self._known[key]), np.inf)

    def _at(self, pitch_y: float, incidence: Floats) -> Floats:
        sheet = self.datasheet
        pitch_x = sheet.x_fov_mm / max(sheet.points_per_profile - 1, 1)
        speckle, kernel = 0.0, None
        if self.surface is not None:
            ready = self.surface.ready(
                pitch_x, pitch_y, z_resolution_um=sheet.z_resolution_um,
                repeatability_um=sheet.repeatability_um or 0.0,
            )  # fmt: skip
            noise = ready.field()
            kernel = speckle_kernel(noise, pitch_x, pitch_y)
            _, speckle = noise.moments_mm(pitch_x, pitch_y)
        independent = float(np.hypot(sigma_mm(sheet), sheet.step_mm / np.sqrt(12)))
        return np.array(
            [
                smallest_depth_mm(angle, pitch_x, pitch_y, independent, speckle, kernel)
                for angle in incidence
            ]
        )


def smallest_depth_mm(
    incidence_rad: float,
    pitch_x_mm: float,
    pitch_y_mm: float,
    white_sd_mm: float,
    speckle_sd_mm: float = 0.0,
    speckle: Floats | None = None,
) -> float:
    """Return the depth of a pit, normal to the surface, at which a matched filter's snr is 5, mm.

    The pit of diameter D and depth h changes readings by h (1 - r²) / cos θ inside an ellipse of
    area π D² cos θ / 4, shortened along the travel. The filter gives (North, Proc. IEEE 51 (1963)
    1016, a reprint of 1943)

        snr = Σ d² / √(dᵀ C d),   C = σ² I + s² K,

    linear in h. White noise alone has the closed form h = 5 σ √(12 px py cos θ / (π D²)) at pitches
    px, py that are small against D. Hidden walls are left out: a pit is shallow here.

    Parameters
    ----------
    incidence_rad
        θ between sight line and normal.
    pitch_x_mm, pitch_y_mm
        Between points and between profiles.
    white_sd_mm
        σ, rounding included.
    speckle_sd_mm, speckle
        s, and the correlation K at all lags of the grid at which it isn't zero.
    """
    cosine = np.cos(incidence_rad)
    half_x, half_y = PIT_MM / 2, PIT_MM / 2 * cosine
    x = np.arange(-np.ceil(half_x / pitch_x_mm) - 1, np.ceil(half_x / pitch_x_mm) + 2) * pitch_x_mm
    y = np.arange(-np.ceil(half_y / pitch_y_mm) - 1, np.ceil(half_y / pitch_y_mm) + 2) * pitch_y_mm
    shifts = (np.arange(LATTICE) + 0.5) / LATTICE - 0.5
    ratios = []
    for dx in shifts * pitch_x_mm:
        for dy in shifts * pitch_y_mm:
            square = ((x + dx) / half_x) ** 2 + (((y + dy) / half_y) ** 2)[:, None]
            change = np.maximum(1 - square, 0) / cosine
            power = noise_power(change * white_sd_mm, None)
            if speckle is not None:
                power += noise_power(change * speckle_sd_mm, speckle)
            ratios.append(float(np.sum(change**2)) / np.sqrt(power) if power > 0 else 0.0)
    mean = float(np.mean(ratios))
    return DETECTED_AT / mean if mean > 0 else np.inf
