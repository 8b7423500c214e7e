"""The surface as light meets it: albedo pattern, specular lobe, translucence, micro relief."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates


@dataclass(frozen=True, kw_only=True, slots=True)
class OpticalSurface:
    """What light does at the surface.

    Attributes
    ----------
    albedo, specular, facet_slope
        Diffuse reflectance; strength of the specular lobe relative to a white plate; rms slope of
        its facets (Beckmann).
    mirror
        Share of the light that goes on to a second surface along the specular lobe (the diffuse
        share follows from `albedo`); 0 switches the second bounce off.
    albedo_ratio, albedo_period_mm, albedo_angle_rad, albedo_share
        Stripes of albedo: reflectance of the dark ones relative to the bright ones, period,
        direction in the part's x-y plane, share of dark.
    depth_mm
        Mean path of the light below the surface before it turns (0: opaque).
    relief_mm, relief_x_mm, relief_y_mm, relief_angle_rad, relief_seed
        Micro relief along the part's z: rms, correlation lengths along and across its lay,
        direction of the lay, seed.
    """

    albedo: float = 0.6
    specular: float = 0.0
    facet_slope: float = 0.15
    mirror: float = 0.0
    albedo_ratio: float = 1.0
    albedo_period_mm: float = 4.0
    albedo_angle_rad: float = 0.3
    albedo_share: float = 0.4
    depth_mm: float = 0.0
    relief_mm: float = 0.0
    relief_x_mm: float = 0.1
    relief_y_mm: float = 0.1
    relief_angle_rad: float = 0.0
    relief_seed: int = 0

    def brightness(self, part_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Reflectance relative to the bright stripes at points (..., 3) of the part frame."""
        if self.albedo_ratio == 1.0:
            return np.ones(part_mm.shape[:-1])
        along = part_mm[..., 0] * np.cos(self.albedo_angle_rad)
        along = along + part_mm[..., 1] * np.sin(self.albedo_angle_rad)
        dark = np.mod(along / self.albedo_period_mm, 1.0) < self.albedo_share
        return np.where(dark, self.albedo_ratio, 1.0)

    def relief(self, part_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the micro relief in mm at points (..., 3) of the part frame."""
        if self.relief_mm == 0.0:
            return np.zeros(part_mm.shape[:-1])
        c, s = np.cos(self.relief_angle_rad), np.sin(self.relief_angle_rad)
        u = part_mm[..., 0] * c + part_mm[..., 1] * s
        v = part_mm[..., 1] * c - part_mm[..., 0] * s
        cell_u, cell_v = self.relief_x_mm / 2, self.relief_y_mm / 2
        size = 1024
        noise = np.random.default_rng(self.relief_seed).standard_normal((size, size))
        # a Gaussian correlation of length 2 cells, periodic after 1024 cells
        freq = np.fft.fftfreq(size)
        shape = np.exp(-((2 * np.pi * freq) ** 2) * 2.0 / 2)
        field = np.fft.ifft2(np.fft.fft2(noise) * shape[:, None] * shape[None, :]).real
        field *= self.relief_mm / field.std()
        at = np.stack([u.ravel() / cell_u, v.ravel() / cell_v])
        height = map_coordinates(field, at, order=1, mode="grid-wrap")
        return np.asarray(height.reshape(u.shape), np.float64)

    def towards(
        self,
        cos_in: NDArray[np.float64],
        cos_out: NDArray[np.float64],
        cos_half: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Light sent towards the camera by a unit of arriving power, per solid angle.

        Lambert ``albedo cos_out / π`` and a Beckmann lobe over the half-vector angle, without
        its shadowing term.

        Parameters
        ----------
        cos_in, cos_out, cos_half : same shape
            Cosines of normal against light, camera and their half vector.

        Returns
        -------
        same shape, 1/sr; zero where the surface turns away
        """
        seen = (cos_in > 0) & (cos_out > 0)
        out = self.albedo * np.maximum(cos_out, 0) / np.pi
        if self.specular > 0:
            cos_h = np.clip(cos_half, 1e-3, 1.0)
            tan_2 = 1 / cos_h**2 - 1
            lobe = np.exp(-tan_2 / self.facet_slope**2) / (
                np.pi * self.facet_slope**2 * cos_h**4
            )
            out = out + self.specular * lobe / (4 * np.maximum(cos_in, 0.05))
        return np.where(seen, out, 0.0)
