"""What lies over or in a surface: oil, clear coat, rubber. Light is refracted, and reads elsewhere.

Born and Wolf, Principles of Optics, sections 1.5 (Snell, Fresnel) and 7.5 (two-beam interference).
A coat answers with layers: where a cell's light seems to come from, and how bright it is.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
QUADRATURE = 4
"""Depths at which light scattered inside a turbid body is looked at (Gauss-Laguerre)."""
_GRAZING = 0.05  # cosine below which a cell counts as unlit or unseen


@dataclass(frozen=True, kw_only=True, slots=True)
class Layer:
    """Light of cells (k, m) that seems to come from beside where the sheet meets the surface.

    Attributes
    ----------
    along_mm, deeper_mm : (k, m) displacement in the sensor's y and z
    base, specular : (k, m) factors on the light of the diffuse base, and of the specular lobe
    """

    along_mm: Floats
    deeper_mm: Floats
    base: Floats
    specular: Floats


class Coat(Protocol):
    """Oil, clear coat or a turbid body."""

    def layers(self, normal: Floats, points_mm: Floats, to_camera: Floats) -> list[Layer]:
        """Layers that a camera sees.

        Parameters
        ----------
        normal, points_mm : (k, m, 3)
            Normals in the sensor's frame, points in the part's.
        to_camera : (3,)
            Sensor frame; the sheet runs along +z.
        """


def refracted(direction: Floats, normal: Floats, ratio: float) -> Floats:
    """Snell's law for unit vectors (..., 3): into the body whose normal is against the light.

    Parameters
    ----------
    ratio : of the indices, outside over inside
    """
    cosine = -(normal * direction).sum(-1, keepdims=True)
    inside = np.sqrt(np.maximum(1 - ratio**2 * (1 - cosine**2), 0.0))
    return np.asarray(ratio * direction + (ratio * cosine - inside) * normal)


def apparent(normal: Floats, to_camera: Floats, index: float) -> tuple[Floats, Floats, Floats]:
    """Where a point inside the body is seen from outside, for a unit way of the sheet in it.

    Returns
    -------
    shift : (..., 3)
        From where the sheet enters to where the sight line leaves; its line is the image.
    path : (...)
        Way in the body, in and out.
    inward : (...)
        Depth across the surface that a unit way reaches.
    """
    light = np.broadcast_to(np.array([0.0, 0.0, 1.0]), normal.shape)
    sight = np.broadcast_to(-to_camera, normal.shape)
    into, back = (refracted(d, normal, 1 / index) for d in (light, sight))
    down, up = -(normal * into).sum(-1), np.maximum(-(normal * back).sum(-1), _GRAZING)
    ratio = down / up
    return into - ratio[..., None] * back, 1 + ratio, down


def fresnel(cosine: Floats, index: float) -> Floats:
    """Reflectance of an interface to unpolarised light that comes from outside."""
    inside = np.sqrt(1 - (1 - cosine**2) / index**2)
    s = (cosine - index * inside) / (cosine + index * inside)
    p = (index * cosine - inside) / (index * cosine + inside)
    return np.asarray((s**2 + p**2) / 2)


@dataclass(frozen=True, kw_only=True, slots=True)
class Film:
    """A clear layer over the surface: oil, thin and uneven, or a clear coat, thick and even.

    Attributes
    ----------
    thickness_mm, unevenness, period_mm
        Mean thickness, its relative amplitude over the part, and over which length it varies.
    index
        Of refraction.
    specular
        Share of the surface's specular lobe that the outer interface keeps.
    wavelength_mm, coherence_mm
        Of the light: fringes fade where the layer's optical path is longer.
    mirror
        Reflectance of the base for the fringes' second beam.
    """

    thickness_mm: float
    unevenness: float = 0.0
    period_mm: float = 6.0
    index: float = 1.47
    specular: float = 1.0
    wavelength_mm: float = 4.5e-4
    coherence_mm: float = 0.02
    mirror: float = 0.1

    def thickness(self, points_mm: Floats) -> Floats:
        """Thickness at points (..., 3) of the part, mm."""
        k = 2 * np.pi / self.period_mm
        x, y = points_mm[..., 0], points_mm[..., 1]
        wave = np.sin(k * x + 0.7 * np.sin(k * y)) * np.sin(0.8 * k * y + 0.4)
        return np.asarray(self.thickness_mm * (1 + self.unevenness * wave))

    def fringes(self, thickness_mm: Floats, cosine_inside: Floats) -> Floats:
        """Relative light in the layer: two beams, contrast fading with the optical path."""
        opd = 2 * self.index * thickness_mm * cosine_inside
        outer = ((self.index - 1) / (self.index + 1)) ** 2
        contrast = 2 * np.sqrt(outer * self.mirror) * np.exp(-((opd / self.coherence_mm) ** 2))
        return np.asarray(1 + contrast * np.cos(2 * np.pi * opd / self.wavelength_mm))

    def layers(self, normal: Floats, points_mm: Floats, to_camera: Floats) -> list[Layer]:
        """Return the base seen through the layer, and the outer interface above it."""
        thick = self.thickness(points_mm)
        shift, _, inward = apparent(normal, to_camera, self.index)
        way = thick / np.maximum(inward, _GRAZING)
        lit, seen = np.maximum(-normal[..., 2], 0.0), np.maximum(normal @ to_camera, 0.0)
        # the sheet enters above the base; seen from there the base is at `shift`
        rise = thick / np.maximum(lit, _GRAZING)
        passed = (1 - fresnel(lit, self.index)) * (1 - fresnel(seen, self.index))
        passed = passed * self.fringes(thick, np.minimum(inward, 1.0))
        nothing = np.zeros_like(thick)
        base = Layer(along_mm=shift[..., 1] * way, deeper_mm=shift[..., 2] * way - rise,
                     base=passed, specular=nothing)  # fmt: skip
        outer = Layer(along_mm=nothing, deeper_mm=-rise, base=nothing,
                      specular=np.full_like(thick, self.specular))  # fmt: skip
        return [base, outer]


@dataclass(frozen=True, kw_only=True, slots=True)
class Turbid:
    """A body that light enters and is scattered in once: rubber, plastic.

    Attributes
    ----------
    free_path_mm
        Way after which 1/e of the light goes on: of scattering and absorption together.
    index
        Of refraction.
    """

    free_path_mm: float
    index: float = 1.5

    def layers(self, normal: Floats, points_mm: Floats, to_camera: Floats) -> list[Layer]:
        """Return depths of single scattering: radiance falls as exp(-way / free path)."""
        del points_mm
        shift, path, _ = apparent(normal, to_camera, self.index)
        at, weights = np.polynomial.laguerre.laggauss(QUADRATURE)
        found = []
        for t, weight in zip(at, weights, strict=True):
            way = t * self.free_path_mm / path
            on_top = np.full(way.shape, float(t == at[0]))
            found.append(
                Layer(along_mm=shift[..., 1] * way, deeper_mm=shift[..., 2] * way,
                      base=np.full(way.shape, weight), specular=on_top)
            )  # fmt: skip
        return found
