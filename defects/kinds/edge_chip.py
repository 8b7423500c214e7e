"""Edge chip: a shell-shaped piece broken out of an outer edge."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.seats.feature_edges import nearest_edge
from defects.seats.seat import Edge, Seat
from defects.shape.edge_section import EdgeSection
from defects.shape.outline import outline
from defects.shape.patch import Patch, dig
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity


@dataclass(frozen=True, kw_only=True, slots=True)
class EdgeChip(Kind):
    """A chip whose floor is a plane across the edge, curved along it and hollowed as a shell is.

    With v along the edge (1 at the chip's end), u across it in reaches, D the depth under the edge
    of the plane that joins both reaches, and m from -1 to 1 across that plane, the floor lies

        T(u, v) = plane(u) - D v² + hollow D (1 - m² - v²) + ripples

    under the edge along the bisector. On an edge of 90° with equal reaches w and hollow 0, D is
    w/√2 and the volume 4 w² length / 15. Chips of one material are alike whatever their size
    (Chai and Lawn, Acta Materialia 55 (2007) 2555); the shell and its ripples are those of brittle
    fracture (Quinn, Fractography of Ceramics and Glasses, NIST SP 960-16). ISO 10110-7 states edge
    chips by their reach from the edge.
    """

    name: ClassVar[str] = "edge_chip"
    class_id: ClassVar[int] = 6
    seat: ClassVar[Seat] = Edge(convex=True)

    length_mm: float = quantity(
        "along the edge", unit="mm", low=0.05, high=100.0, typical=(1.0, 6.0)
    )
    reach_mm: float = quantity(
        "reach from the edge on the face with the larger reach",
        unit="mm", low=0.02, high=50.0, typical=(0.4, 2.0),
    )
    aspect: float = quantity(
        "reach on the other face over `reach_mm`", low=0.1, high=1.0, typical=(0.3, 0.9)
    )
    hollow: float = quantity(
        "0: a flat break; 1: a deep shell", low=0.0, high=2.0, typical=(0.1, 0.6)
    )
    irregularity: float = quantity(
        "standard deviation of the outline, relative", low=0.0, high=0.3, typical=(0.04, 0.12)
    )
    ripple: float = quantity(
        "height of the ripples over the depth", low=0.0, high=0.2, typical=(0.01, 0.05)
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the solid that breaks out; side, outline and ripples are drawn."""
        if self.reach_mm > 2 * self.length_mm:
            raise SiteError("edge_chip: reaches more than twice its length from the edge")
        left = bool(rng.integers(2))
        reach = (self.reach_mm, self.reach_mm * self.aspect)[:: 1 if left else -1]
        phase, rings = rng.uniform(0, 2 * np.pi), rng.uniform(2.0, 4.0)
        headings = np.linspace(0, 2 * np.pi, 720, endpoint=False)
        edge_of = outline(headings, self.irregularity, rng)
        end = 1.08 * float(edge_of.max())
        chain, at = nearest_edge(surface, site.position_mm, convex=True)
        n = int(np.clip(self.length_mm / np.sqrt(24 * sagitta_mm * self.length_mm), 24, 72))
        v = np.linspace(-end, end, n + 1)
        u = np.linspace(-end, end, 2 * (n // 2) + 1)
        frames = chain.frames(at + v * self.length_mm / 2)
        section = EdgeSection.of(frames, (reach[0], reach[1]))
        patch = Patch.along_edge(frames, v, u, (reach[0], reach[1]))
        v_at, u_at = patch.first, patch.second
        angle = np.arctan2(v_at, section.middle(u_at))
        wide = np.interp(angle, headings, edge_of, period=2 * np.pi)
        along, across = v_at / wide, u_at / wide
        middle = section.middle(across)
        square = middle**2 + along**2
        depth = section.depth_mm
        floor = section.plane(across) - depth * along**2 + self.hollow * depth * (1 - square)
        window = np.clip(1 - square, 0.0, 1.0)
        waves = np.cos(2 * np.pi * rings * np.sqrt(square) + phase)
        floor = floor + self.ripple * depth * window * waves
        height = np.minimum(section.skin(u_at) - floor, 0.4 * depth)
        return dig(patch, height, height < 0, depth)
