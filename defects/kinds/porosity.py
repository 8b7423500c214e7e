"""Surface pores of a weld or casting: gas bubbles that broke through the skin."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.shape.patch import Patch, dig, merge
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Porosity(Kind):
    """Round pores, in a row or in a cluster.

    A pore's floor is that of an ellipsoid cut by the skin, -depth √(1 - rho²); its wall stands
    upright at the rim. The diameters follow a lognormal distribution below `diameter_mm`, the
    largest. ISO 6520-1 numbers 2017 (surface pore), 2013 (cluster), 2014 (row); ISO 5817 allows
    diameters up to 3 mm (level D), none in level B for thin sheet.
    """

    name: ClassVar[str] = "porosity"
    class_id: ClassVar[int] = 11

    diameter_mm: float = quantity(
        "of the largest pore", unit="mm", low=0.05, high=10.0, typical=(0.4, 2.0)
    )
    depth_ratio: float = quantity(
        "depth of a pore over its diameter", low=0.1, high=1.5, typical=(0.35, 0.9)
    )
    pores: float = quantity("number of pores", low=1, high=60, typical=(2, 9), whole=True)
    spread_mm: float = quantity(
        "standard deviation of their places along the heading",
        unit="mm", low=0.1, high=100.0, typical=(1.5, 6.0),
    )
    row: float = quantity(
        "0: a round cluster; 1: all in a row along the heading",
        low=0.0, high=1.0, typical=(0.0, 1.0),
    )
    scatter: float = quantity(
        "standard deviation of the logarithm of the diameters",
        low=0.0, high=1.0, typical=(0.2, 0.5),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the pores; their places and diameters are drawn."""
        cutters = [self._one(surface, site, self.diameter_mm, sagitta_mm)]
        for _ in range(int(self.pores) - 1):
            share = float(np.exp(-abs(rng.normal(0.0, self.scatter)) - 0.1))
            along, across = rng.normal(size=2) * self.spread_mm
            across *= 1.0 - 0.95 * self.row
            away = float(np.hypot(along, across))
            least = 0.55 * (1 + share) * self.diameter_mm
            turn = float(np.arctan2(across, along))
            walk = surface.walk(
                site.position_mm[None], site.direction(turn)[None],
                np.array([[max(away, least)]]),
            )  # fmt: skip
            if not walk.complete.all():
                raise SiteError("the flaw would cross an edge of the part")
            there = Site(
                position_mm=walk.points_mm[0, 0], normal=walk.normals[0, 0],
                heading_rad=site.heading_rad, triangle=int(walk.triangles[0, 0]),
            )  # fmt: skip
            cutters.append(self._one(surface, there, share * self.diameter_mm, sagitta_mm))
        return merge(cutters)

    def _one(self, surface: Surface, site: Site, diameter: float, sagitta: float) -> Cutter:
        radius, depth = diameter / 2, diameter * self.depth_ratio
        sagitta *= 3
        sectors = int(np.clip(4 * np.ceil(np.pi / 2 * np.sqrt(radius / (2 * sagitta))), 24, 96))
        rings = int(np.clip(np.ceil(np.sqrt(depth / sagitta)), 6, 24))
        # Even steps in the angle at the ellipsoid's middle, so that the wall is drawn well.
        inner = np.sin(np.linspace(0.0, np.pi / 2, rings + 1)[1:])
        rho = np.concatenate([inner, [1.05]])
        patch = Patch.disk(surface, site, np.full(sectors, radius), rho)
        height = -depth * np.sqrt(np.maximum(1.0 - patch.first**2, 0.0))
        height = np.where(patch.first > 1.0, 0.3 * depth, height)
        return dig(patch, height, patch.first <= 1.0, depth)
