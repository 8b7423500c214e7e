"""A surface of micro-facets with a lay: how bright it is towards the camera, and its speckle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from challenge.second.coating import Coat

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Facets:
    """Anisotropic Trowbridge-Reitz facets over a diffuse base (Heitz, JCGT 3(2), 2014).

    Attributes
    ----------
    albedo
        Of the diffuse base.
    mirror
        Reflectance of the facets.
    slope_along, slope_across
        Facets' slope along and across the lay.
    lay_rad
        Direction of the lay in the part's x-y plane.
    modes
        Independent speckle patterns that a cell averages: contrast is modes^-1/2.
    albedo_ratio, albedo_period_mm, albedo_rad
        Printed stripes: their brightness against the ground, 1 for none.
    coat
        What lies over or in the surface.
    bounces
        Whether light that walls send on to each other is followed.
    """

    albedo: float = 0.5
    mirror: float = 0.012
    slope_along: float = 0.25
    slope_across: float = 0.35
    lay_rad: float = 0.0
    modes: float = 12.0
    albedo_ratio: float = 1.0
    albedo_period_mm: float = 4.0
    albedo_rad: float = 0.0
    coat: Coat | None = None
    bounces: bool = False

    def density(self, half: Floats, along: Floats, across: Floats) -> Floats:
        """Density of facets whose normal is the half vector, per steradian.

        Parameters
        ----------
        half, along, across : (...)
            Components of the half vector: along the normal, along the lay, across it.
        """
        a, b = self.slope_along, self.slope_across
        inside = (along / a) ** 2 + (across / b) ** 2 + half**2
        return np.asarray(1 / (np.pi * a * b * inside**2))

    def towards(
        self, normal: Floats, lay: Floats, to_laser: Floats, to_camera: Floats
    ) -> tuple[Floats, Floats]:
        """Radiance of the diffuse base and of the facets towards the camera.

        The points are lit with unit irradiance across the sheet.

        Parameters
        ----------
        normal, lay : (..., 3)
            Unit normals, and unit directions of the lay in the surface.
        to_laser, to_camera : (3,)
            Unit vectors from the surface.
        """
        lit = np.maximum(normal @ to_laser, 0.0)
        seen = normal @ to_camera
        half = to_laser + to_camera
        half = half / np.linalg.norm(half)
        along = lay @ half
        across = np.cross(normal, lay) @ half
        specular = self.mirror * self.density(normal @ half, along, across)
        specular = specular / (4 * np.maximum(seen * lit, 0.05)) * lit
        shown = seen > 0.02
        return np.where(shown, self.albedo / np.pi * lit, 0.0), np.where(shown, specular, 0.0)

    def albedo_pattern(self, points_mm: Floats) -> Floats:
        """Relative brightness of points (..., 3) in the part frame."""
        if self.albedo_ratio == 1.0:
            return np.ones(points_mm.shape[:-1])
        c, s = np.cos(self.albedo_rad), np.sin(self.albedo_rad)
        u = points_mm[..., 0] * c + points_mm[..., 1] * s
        return np.where(np.mod(u / self.albedo_period_mm, 1.0) < 0.5, self.albedo_ratio, 1.0)

    def speckle(self, shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
        """Relative brightness of cells: gamma-distributed, mean 1 (Goodman, section 6)."""
        return rng.gamma(self.modes, 1 / self.modes, shape)
