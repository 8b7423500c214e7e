"""Edge burr: a ragged fin of displaced material on an outer edge."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.seats.feature_edges import nearest_edge
from defects.seats.seat import Edge, Seat
from defects.shape.lid import reshape
from defects.shape.patch import Patch
from defects.shape.track import smooth_noise
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class EdgeBurr(Kind):
    """A burr left by milling, drilling or shearing: material that protrudes beyond the edge.

    Its section is a triangle with a root on both faces; its crest is ragged along the edge and
    falls to the edge at both ends. ISO 13715 calls it a burr (an edge of undefined shape with an
    overhang) and states its height. On an edge of 90° the even part of the crest has the section
    area root height / √2.
    """

    name: ClassVar[str] = "edge_burr"
    class_id: ClassVar[int] = 7
    seat: ClassVar[Seat] = Edge(convex=True)

    length_mm: float = quantity(
        "along the edge", unit="mm", low=0.3, high=300.0, typical=(4.0, 25.0)
    )
    height_mm: float = quantity(
        "approximate greatest height over the edge; the manifest records the exact height",
        unit="mm", low=0.01, high=5.0, typical=(0.08, 0.5),
    )
    root_mm: float = quantity(
        "reach of its root on each of the two faces",
        unit="mm", low=0.01, high=3.0, typical=(0.06, 0.25),
    )
    lean_deg: float = quantity(
        "angle between the fin and the bisector of the faces' normals, to the left",
        unit="°", low=-28.0, high=28.0, typical=(-25.0, 25.0),
    )
    raggedness: float = quantity(
        "0: an even crest; 1: the crest falls to a tenth of its height in places",
        low=0.0, high=1.0, typical=(0.3, 0.8),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the fin; its crest is drawn."""
        if self.root_mm > self.length_mm / 4 or self.height_mm > 8 * self.root_mm:
            raise SiteError("edge_burr: its root is too wide or too narrow for its size")
        chain, at = nearest_edge(surface, site.position_mm, convex=True)
        step = float(np.clip(0.5 * self.root_mm, 0.02, self.length_mm / 40))
        n = int(np.clip(self.length_mm / step, 40, 240))
        v = np.linspace(-1.06, 1.06, n + 1)
        across = np.array([-1.12, -1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.12])
        reach = (self.root_mm, self.root_mm)
        patch = Patch.along_edge(
            chain.frames(at + v * self.length_mm / 2), v, across, reach,
            np.deg2rad(self.lean_deg),
        )  # fmt: skip
        along = patch.first * self.length_mm / 2
        crest = self._crest(along, rng)
        share = 1.0 - np.maximum(np.abs(patch.second), patch.first**4)
        height = self.height_mm * np.where(share > 0, crest * share, 0.3 * share)
        margin = float(np.clip(0.2 * self.root_mm, 0.002, 0.05))
        return reshape(patch, height, None, None, margin)

    def _crest(self, along: Floats, rng: np.random.Generator) -> Floats:
        """Return the crest's height over `height_mm`, 0.1 to 1, at positions along the edge."""
        coarse = smooth_noise(along, 6 * self.root_mm, rng)
        fine = smooth_noise(along, 2 * self.root_mm, rng)
        fall = np.clip(0.45 + 0.3 * coarse + 0.15 * fine, 0.0, 0.9)
        return np.asarray(1.0 - self.raggedness * fall)
