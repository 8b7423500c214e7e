"""Wear: a flat worn land on an edge or ridge."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.seats.feature_edges import nearest_edge
from defects.seats.seat import Edge, Seat
from defects.shape.edge_section import EdgeSection
from defects.shape.patch import Patch, dig
from defects.shape.track import smooth_noise
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity


@dataclass(frozen=True, kw_only=True, slots=True)
class Wear(Kind):
    """An outer edge that is worn down to a land.

    The land is the plane across the edge that cuts both faces `land_mm` apart, with grooves along
    the edge; towards its ends it rises to the edge as a parabola does. Over the middle of an edge
    of 90° worn evenly its section has the area land² / 4. ISO 3685 states the wear of cutting
    edges as the width of such a land.
    """

    name: ClassVar[str] = "wear"
    class_id: ClassVar[int] = 13
    seat: ClassVar[Seat] = Edge(convex=True)

    length_mm: float = quantity(
        "along the edge", unit="mm", low=0.5, high=500.0, typical=(5.0, 30.0)
    )
    land_mm: float = quantity(
        "width of the land", unit="mm", low=0.02, high=20.0, typical=(0.3, 1.5)
    )
    tilt: float = quantity(
        "-1 to 1: how much more of the land lies on the left (right) face than on the other",
        low=-0.8,
        high=0.8,
        typical=(-0.4, 0.4),
    )
    runout: float = quantity(
        "share of the length over which the land rises to the edge",
        low=0.1,
        high=1.0,
        typical=(0.2, 0.6),
    )
    groove_ratio: float = quantity(
        "depth of the grooves over the land's depth under the edge",
        low=0.0,
        high=0.2,
        typical=(0.0, 0.06),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the solid that is worn off; only the grooves are drawn."""
        if self.land_mm > self.length_mm:
            raise SiteError("wear: wider than long")
        chain, at = nearest_edge(surface, site.position_mm, convex=True)
        half = self.length_mm / 2
        n = int(np.clip(self.length_mm / 0.25, 40, 200))
        v = np.linspace(-1.12, 1.12, n + 1)
        frames = chain.frames(at + v * half)
        one = EdgeSection.of(frames, (1.0 + self.tilt, 1.0 - self.tilt))
        width = float(np.hypot(one.left_x + one.right_x, one.left_depth - one.right_depth))
        unit = self.land_mm / width
        reach = (unit * (1.0 + self.tilt), unit * (1.0 - self.tilt))
        section = EdgeSection.of(frames, reach)
        u = np.linspace(-1.2, 1.2, 25)
        patch = Patch.along_edge(frames, v, u, reach)
        fade = np.maximum(np.abs(patch.first) - (1 - self.runout), 0.0) / self.runout
        depth = section.depth_mm
        across = section.middle(patch.second)
        groove = smooth_noise(across, 0.3, rng) * np.clip(1 - fade**2, 0, 1)
        groove = groove * np.clip(1 - across**2, 0.0, 1.0)
        floor = section.plane(patch.second) - depth * fade**2
        floor = floor + 0.5 * self.groove_ratio * depth * np.clip(groove, -2, 2)
        height = np.minimum(section.skin(patch.second) - floor, 0.4 * depth)
        return dig(patch, height, height < 0, depth)
