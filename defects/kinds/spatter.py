"""Spatter: drops of weld metal that flew off and stuck to the skin."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.kinds.bump import drop
from defects.shape.patch import merge
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity


@dataclass(frozen=True, kw_only=True, slots=True)
class Spatter(Kind):
    """Drops scattered over the skin beside a weld, each approximately a spherical cap.

    Their diameters follow a lognormal distribution below `diameter_mm`, the largest; ISO 6520-1
    number 602. Diameters of 0.2 to 3 mm are typical of gas-shielded arc welding.
    """

    name: ClassVar[str] = "spatter"
    class_id: ClassVar[int] = 12

    diameter_mm: float = quantity(
        "of the largest drop", unit="mm", low=0.1, high=10.0, typical=(0.6, 2.5)
    )
    height_ratio: float = quantity(
        "height of a drop over its diameter", low=0.1, high=0.8, typical=(0.25, 0.5)
    )
    drops: float = quantity("number of drops", low=1, high=60, typical=(3, 12), whole=True)
    spread_mm: float = quantity(
        "standard deviation of their distance from the largest",
        unit="mm", low=0.2, high=200.0, typical=(3.0, 12.0),
    )
    scatter: float = quantity(
        "standard deviation of the logarithm of the diameters",
        low=0.0, high=1.2, typical=(0.3, 0.8),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the drops; a drop that would cross an edge of the part is omitted."""
        cutters = [self._one(surface, site, self.diameter_mm, rng, sagitta_mm)]
        for _ in range(int(self.drops) - 1):
            share = float(np.exp(-abs(rng.normal(0.0, self.scatter)) - 0.15))
            apart = float(rng.rayleigh(self.spread_mm)) + 0.7 * self.diameter_mm
            try:
                there = surface.site_at(site, apart, rng)
                cutters.append(
                    self._one(surface, there, share * self.diameter_mm, rng, sagitta_mm)
                )
            except SiteError:
                continue
        return merge(cutters)

    def _one(
        self,
        surface: Surface,
        site: Site,
        diameter: float,
        rng: np.random.Generator,
        sagitta: float,
    ) -> Cutter:
        half = (diameter / 2, 0.9 * diameter / 2)
        return drop(surface, site, half, diameter * self.height_ratio, 2.6, 0.05, rng, sagitta)
