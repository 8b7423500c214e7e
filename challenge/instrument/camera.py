"""The camera: a pinhole beside the laser, its chip, its lens and the size of its speckle.

The chip stands parallel to the base line between laser and camera, so that a chip column
sees exactly one ray of the laser fan, and depth moves the spot along the column:
``row = centre + f (tan θ0 + (κ y - b) / z)``. The lens is f-theta along the line. Distortion
is modelled along the rows only: columns are by definition the rays that the maker states.
"""

from dataclasses import dataclass
from math import cos, sin, tan

import numpy as np
from numpy.typing import NDArray

PUPIL = 0.2156  # amplitude spread over wavelength / sin u: equal correlation length, round pupil


@dataclass(frozen=True, kw_only=True, slots=True)
class Camera:
    """Geometry, lens and chip.

    Attributes
    ----------
    working_distance_mm, triangulation_rad, side
        Where it sits: ``(0, side * working_distance * tan(triangulation), 0)``.
    columns, fov_rad
        Chip columns, one for each ray of the fan; first ray at ``-fov/2``, last ``+fov/2``.
    rows, row_pitch_mm
        Chip rows, and a row's pitch in the object, across the line of sight, at the
        working distance.
    sin_u
        Aperture on the object's side.
    smile, keystone, barrel
        Row distortion: ``row += smile X² + keystone X Y + barrel Y (X² + Y²)``, X and Y the
        normalised column and row position (-1 to 1), in rows.
    full_well_e, read_noise_e, bits
        Chip: electrons at saturation, read noise, converter.
    fill
        Share of the full well that a matt plate reaches at the working distance, on average
        over the line's middle row.
    ambient_e, ambient_ripple, ambient_hz, ambient_tilt
        Background electrons in a pixel, its modulation (0 to 1), its frequency, and its
        relative rise from the first to the last row.
    bloom
        Share of the charge beyond the full well that runs into the neighbouring rows.
    """

    working_distance_mm: float
    triangulation_rad: float
    side: int
    columns: int
    fov_rad: float
    rows: int
    row_pitch_mm: float
    sin_u: float = 0.005
    smile: float = 1.5
    keystone: float = 0.4
    barrel: float = 0.5
    full_well_e: float = 15000.0
    read_noise_e: float = 12.0
    bits: int = 10
    fill: float = 0.25
    ambient_e: float = 30.0
    ambient_ripple: float = 0.0
    ambient_hz: float = 100.0
    ambient_tilt: float = 0.0
    bloom: float = 1.0

    @property
    def base_mm(self) -> float:
        """Distance between laser and camera."""
        return self.working_distance_mm * tan(self.triangulation_rad)

    @property
    def focal_rows(self) -> float:
        """Focal length in rows."""
        return self.working_distance_mm * cos(self.triangulation_rad) / self.row_pitch_mm

    @property
    def step_rad(self) -> float:
        """Angle between neighbouring columns."""
        return self.fov_rad / (self.columns - 1)

    @property
    def column_pitch_mm(self) -> float:
        """Distance of neighbouring columns at the working distance."""
        return self.working_distance_mm * self.step_rad

    def amplitude_spread_mm(self, wavelength_mm: float) -> float:
        """Spread of the coherent point image, as a Gaussian, in the object."""
        return PUPIL * wavelength_mm / self.sin_u

    def depth_to_row_slope(self) -> float:
        """Rows that a millimetre of depth makes at the working distance."""
        return sin(self.triangulation_rad) / self.row_pitch_mm

    def angles_rad(self) -> NDArray[np.float64]:
        """Angle of the ray that each column sees, (columns,)."""
        return np.linspace(-self.fov_rad / 2, self.fov_rad / 2, self.columns)

    def row_of(
        self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64], z_mm: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Chip row on which a point of the sensor frame appears (any shape)."""
        tan_0 = tan(self.triangulation_rad)
        row = self.focal_rows * (tan_0 + (self.side * y_mm - self.base_mm) / z_mm)
        across = np.arctan2(x_mm, z_mm) / (self.fov_rad / 2)
        along = row / (self.rows / 2)
        bent = (
            self.smile * across**2
            + self.keystone * across * along
            + self.barrel * along * (across**2 + along**2)
        )
        return (self.rows - 1) / 2 + row + bent
