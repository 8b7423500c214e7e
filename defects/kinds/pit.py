"""Pit: an irregular hole with steep walls, alone or in a cluster, as corrosion makes it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.shape.outline import outline
from defects.shape.patch import Patch, dig, merge
from defects.surface.surface import Site, Surface
from quantity import quantity

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Pit(Kind):
    """One pit or a cluster of them.

    Each pit has an outline `radius(angle)` of low harmonics and the floor

        w(rho) = -depth (1 - rho^steepness) (1 + waves),

    where the waves, smooth over the floor, leave the outline as it is. In a cluster the first
    pit has the full size; the others are smaller, and shallower in proportion.
    """

    name: ClassVar[str] = "pit"
    class_id: ClassVar[int] = 3

    diameter_mm: float = quantity(
        "mean diameter of the largest pit", unit="mm", low=0.05, high=30.0, typical=(0.4, 3.0)
    )
    depth_mm: float = quantity(
        "approximate depth of the largest pit; the manifest records the exact depth",
        unit="mm", low=0.005, high=10.0, typical=(0.1, 0.8),
    )
    irregularity: float = quantity(
        "standard deviation of the outline's radius, relative",
        low=0.0, high=0.3, typical=(0.05, 0.13),
    )
    steepness: float = quantity(
        "2: a bowl; 4 and more: a flat floor with steep walls",
        low=1.5, high=8.0, typical=(2.0, 4.0),
    )
    pits: float = quantity("number of pits", low=1, high=40, typical=(1, 6), whole=True)
    spread_mm: float = quantity(
        "standard deviation of the others' distance from the first",
        unit="mm", low=0.1, high=50.0, typical=(1.0, 4.0),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the pits' solids and join them."""
        cutters = [self._one(surface, site, 1.0, rng, sagitta_mm)]
        for _ in range(int(self.pits) - 1):
            share = float(rng.uniform(0.25, 0.8))
            # Rayleigh: a normal scatter in the plane; never so near that it vanishes in the first.
            apart = float(rng.rayleigh(self.spread_mm)) + 0.35 * self.diameter_mm
            there = surface.site_at(site, apart, rng)
            cutters.append(self._one(surface, there, share, rng, sagitta_mm))
        return merge(cutters)

    def _one(
        self, surface: Surface, site: Site, share: float, rng: np.random.Generator, sagitta: float
    ) -> Cutter:
        radius, depth = share * self.diameter_mm / 2, share * self.depth_mm
        sagitta *= 3  # the shape is irregular anyway, and clusters have many facets
        sectors = int(np.clip(16 * np.ceil(np.pi / 8 * np.sqrt(radius / (8 * sagitta))), 32, 160))
        rings = int(np.clip(np.ceil(np.sqrt(depth * self.steepness**2 / (4 * sagitta))), 8, 48))
        angles = np.linspace(0, 2 * np.pi, sectors, endpoint=False)
        ring = radius * outline(angles, self.irregularity, rng)
        rho = np.concatenate([np.linspace(0, 1, rings + 1)[1:], [1.06, 1.12]])
        patch = Patch.disk(surface, site, ring, rho)
        wave, phase = rng.normal(size=(4, 2)) * 1.8, rng.uniform(0, 2 * np.pi, 4)
        x, y = patch.first * np.cos(patch.second), patch.first * np.sin(patch.second)
        waves = np.cos(x[:, None] * wave[:, 0] + y[:, None] * wave[:, 1] + phase).mean(axis=1)
        fall = 1.0 - patch.first**self.steepness
        height = -depth * fall * (1 + 1.5 * self.irregularity * waves)
        return dig(patch, height, patch.first <= 1.0, depth, sagitta)
