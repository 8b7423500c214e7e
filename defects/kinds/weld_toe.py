"""Flaws along the toe of a weld: undercut and missing fusion, two shapes of one groove."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.seats.feature_edges import nearest_edge
from defects.seats.seat import Edge, Seat
from defects.shape.patch import Patch, dig
from defects.shape.track import smooth_noise
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity

Floats = NDArray[np.float64]

INNER_EDGE = Edge(convex=False)


@dataclass(frozen=True, kw_only=True, slots=True)
class Undercut(Kind):
    """A groove melted into the parent metal along the toe of a weld.

    Its section is a parabola over both faces of the inner edge; depth and width vary along it.
    ISO 6520-1 numbers 5011 (continuous) and 5012 (intermittent); ISO 5817 allows depths of 0.5 mm
    (level B), 1 mm (level D) at most.
    """

    name: ClassVar[str] = "undercut"
    class_id: ClassVar[int] = 9
    seat: ClassVar[Seat] = INNER_EDGE

    length_mm: float = quantity(
        "along the toe", unit="mm", low=0.5, high=500.0, typical=(5.0, 40.0)
    )
    width_mm: float = quantity(
        "reach on both faces together", unit="mm", low=0.1, high=20.0, typical=(0.8, 2.5)
    )
    depth_mm: float = quantity(
        "approximate greatest depth under the faces, along the bisector; the manifest records the "
        "exact depth",
        unit="mm", low=0.02, high=5.0, typical=(0.15, 0.8),
    )
    unevenness: float = quantity(
        "standard deviation of depth and width along the toe, relative",
        low=0.0, high=0.4, typical=(0.1, 0.25),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the groove; its unevenness is drawn."""
        if self.depth_mm > self.width_mm:
            raise SiteError("undercut: deeper than wide")
        return _groove(
            surface, site, rng, name=self.name, length_mm=self.length_mm,
            reach_mm=self.width_mm / 2, depth_mm=self.depth_mm, exponent=2.0,
            unevenness=self.unevenness,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class LackOfFusion(Kind):
    """A narrow gap along the toe of a weld where the bead didn't fuse with the parent metal.

    Its section is a V over both faces of the inner edge. ISO 6520-1 number 401; ISO 5817 permits
    none that reaches the surface.
    """

    name: ClassVar[str] = "lack_of_fusion"
    class_id: ClassVar[int] = 10
    seat: ClassVar[Seat] = INNER_EDGE

    length_mm: float = quantity(
        "along the toe", unit="mm", low=0.5, high=500.0, typical=(3.0, 25.0)
    )
    opening_mm: float = quantity(
        "width of the gap at the surface", unit="mm", low=0.02, high=3.0, typical=(0.1, 0.5)
    )
    depth_mm: float = quantity(
        "approximate greatest depth along the bisector; the manifest records the exact depth",
        unit="mm", low=0.02, high=10.0, typical=(0.3, 1.5),
    )
    unevenness: float = quantity(
        "standard deviation of depth and opening along the toe, relative",
        low=0.0, high=0.4, typical=(0.1, 0.3),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the gap; its unevenness is drawn."""
        if self.opening_mm > self.length_mm / 4:
            raise SiteError("lack_of_fusion: wider than a quarter of its length")
        return _groove(
            surface, site, rng, name=self.name, length_mm=self.length_mm,
            reach_mm=self.opening_mm / 2, depth_mm=self.depth_mm, exponent=1.0,
            unevenness=self.unevenness,
        )  # fmt: skip


def _groove(
    surface: Surface,
    site: Site,
    rng: np.random.Generator,
    *,
    name: str,
    length_mm: float,
    reach_mm: float,
    depth_mm: float,
    exponent: float,
    unevenness: float,
) -> Cutter:
    """Cut -depth (1 - v⁴ - |u|^exponent) along an inner edge, u in uneven reaches, v in halves."""
    if 2 * reach_mm > length_mm:
        raise SiteError(f"{name}: wider than long")
    chain, at = nearest_edge(surface, site.position_mm, convex=False)
    n = int(np.clip(2 * length_mm / reach_mm, 40, 200))
    v = np.linspace(-1.06, 1.06, n + 1)
    u = np.linspace(-1.8, 1.8, 37)
    patch = Patch.along_edge(
        chain.frames(at + v * length_mm / 2), v, u, (reach_mm, reach_mm)
    )
    along = patch.first * length_mm / 2
    wide = np.clip(1 + unevenness * smooth_noise(along, 8 * reach_mm, rng), 0.5, 1.6)
    deep = np.clip(1 + unevenness * smooth_noise(along, 6 * reach_mm, rng), 0.4, 1.6)
    fall = 1 - patch.first**4 - np.abs(patch.second / wide) ** exponent
    height = np.where(fall > 0, -depth_mm * deep * fall, -0.5 * min(depth_mm, reach_mm) * fall)
    height = np.minimum(height, 0.4 * depth_mm)
    return dig(patch, height, height < 0, depth_mm)
