"""Bump: material on the surface, a weld spatter with droplets around it or a burr."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.shape.lid import reshape
from defects.shape.outline import outline
from defects.shape.patch import Patch, merge
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Bump(Kind):
    """A drop of solidified material, alone or with smaller ones around it.

    Its surface stands `height (1 - rho^fullness)` over the skin, rho being the radius ratio to
    an uneven outline, and meets the skin at an angle.
    """

    name: ClassVar[str] = "bump"
    class_id: ClassVar[int] = 5

    length_mm: float = quantity(
        "mean axis along the heading", unit="mm", low=0.05, high=50.0, typical=(0.5, 3.0)
    )
    aspect: float = quantity(
        "other axis over `length_mm`; small values make a burr",
        low=0.05, high=1.0, typical=(0.6, 1.0),
    )
    height_mm: float = quantity(
        "height at the middle", unit="mm", low=0.005, high=10.0, typical=(0.15, 0.8)
    )
    fullness: float = quantity(
        "2: a paraboloid; more: flatter on top with steeper flanks",
        low=1.5, high=8.0, typical=(2.2, 3.5),
    )
    irregularity: float = quantity(
        "standard deviation of the outline's radius, relative",
        low=0.0, high=0.3, typical=(0.02, 0.1),
    )
    droplets: float = quantity(
        "number of smaller drops around it", low=0, high=40, typical=(0, 5), whole=True
    )
    spread_mm: float = quantity(
        "standard deviation of their distance", unit="mm", low=0.1, high=50.0, typical=(1.0, 4.0)
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the drops' lids and join them."""
        if self.height_mm > 2 * self.length_mm * self.aspect:
            raise SiteError("bump: more than twice as high as wide")
        cutters = [self._one(surface, site, 1.0, rng, sagitta_mm)]
        for _ in range(int(self.droplets)):
            share = float(rng.uniform(0.12, 0.45))
            apart = float(rng.rayleigh(self.spread_mm)) + 0.6 * self.length_mm
            there = surface.site_at(site, apart, rng)
            cutters.append(self._one(surface, there, share, rng, sagitta_mm))
        return merge(cutters)

    def _one(
        self, surface: Surface, site: Site, share: float, rng: np.random.Generator, sagitta: float
    ) -> Cutter:
        a = share * self.length_mm / 2
        return drop(
            surface, site, (a, a * self.aspect), share * self.height_mm, self.fullness,
            self.irregularity, rng, sagitta,
        )  # fmt: skip


def drop(
    surface: Surface,
    site: Site,
    half_mm: tuple[float, float],
    height: float,
    fullness: float,
    irregularity: float,
    rng: np.random.Generator,
    sagitta: float,
) -> Cutter:
    """Build one drop of half axes along and across the heading; `Bump` states its shape."""
    a, b = half_mm
    sagitta *= 3  # the shape is irregular anyway, and spatters have many drops
    sectors = int(np.clip(8 * np.ceil(np.pi / 4 * np.sqrt(height / (2 * sagitta))), 24, 200))
    rings = int(np.clip(np.ceil(fullness * np.sqrt(height / (8 * sagitta))), 6, 64))
    angles = np.linspace(0, 2 * np.pi, sectors, endpoint=False)
    radius = outline(angles, irregularity, rng) / np.hypot(np.cos(angles) / a, np.sin(angles) / b)
    rho = np.concatenate([np.linspace(0, 1, rings + 1)[1:], [1.05, 1.1]])
    patch = Patch.disk(surface, site, radius, rho)
    margin = float(np.clip(0.2 * height, 0.003, 0.05))
    return reshape(
        patch, height * (1 - patch.first**fullness), None, None, margin, sagitta_mm=sagitta
    )
