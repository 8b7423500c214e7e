"""Crack: a meandering, branching cleft of V section that tapers off."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter, Solid
from defects.kind import Kind
from defects.shape.patch import merge
from defects.shape.track import Track, smooth_noise
from defects.surface.surface import Site, Surface
from quantity import quantity

Floats = NDArray[np.float64]

TIP = 0.03
"""Share of opening and depth that is left at a tip, so that its end is a small clean face."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Crack(Kind):
    """A cleft along a path with corners.

    At the position v along the path (0 in the middle, 1 at a tip) it is
    `depth (1 - v^4)` deep along the local normal and about `opening (1 - |v|^1.5)^0.7` wide,
    with random widening and narrowing; both leave a share `TIP` at the tip. Branches
    start at the main path, are narrower and shallower, and taper towards their one tip.
    """

    name: ClassVar[str] = "crack"
    class_id: ClassVar[int] = 2

    length_mm: float = quantity(
        "length along the path", unit="mm", low=0.5, high=500.0, typical=(6.0, 40.0)
    )
    opening_mm: float = quantity(
        "approximate greatest width at the skin",
        unit="mm",
        low=0.005,
        high=3.0,
        typical=(0.08, 0.4),
    )
    depth_mm: float = quantity(
        "greatest depth along the local normal", unit="mm", low=0.01, high=20.0, typical=(0.2, 1.5)
    )
    meander: float = quantity(
        "standard deviation of the heading, in units of 0.5 rad",
        low=0.0,
        high=1.5,
        typical=(0.5, 1.0),
    )
    branches: float = quantity("number of branches", low=0, high=8, typical=(0, 3), whole=True)

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Walk the path and its branches and sweep the V along them."""
        half = self.length_mm / 2
        bend = max(surface.curvature_per_mm(site, half), 1e-9)
        edge = max(float(np.sqrt(8 * sagitta_mm / bend)), 0.05)
        trunk = Track.walked(
            surface, site.position_mm, site.direction(),
            self._wander(half, edge, rng), self._wander(half, edge, rng),
        )  # fmt: skip
        v = np.clip(trunk.along_mm / half, -1.0, 1.0)
        width, depth = self._taper(v, trunk.along_mm, rng)
        cutters = [self._sweep(trunk, width, depth)]
        for _ in range(int(self.branches)):
            i = int(rng.integers(int(0.15 * len(v)), int(0.85 * len(v)) + 1))
            length = float(rng.uniform(0.12, 0.35)) * self.length_mm
            angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.45, 1.0))
            side = np.cross(trunk.normals[i], trunk.directions[i])
            sign = float(rng.choice([-1.0, 1.0]))
            heading = np.cos(angle) * trunk.directions[i] * sign + np.sin(angle) * side
            branch = Track.walked(
                surface, trunk.points_mm[i], heading, self._wander(length, edge, rng)
            )
            w, d = self._taper(np.clip(branch.along_mm / length, 0, 1), branch.along_mm, rng)
            narrow = 0.7 * width[i] / self.opening_mm
            cutters.append(self._sweep(branch, narrow * w, 0.8 * depth[i] / self.depth_mm * d))
        return merge(cutters)

    def _wander(
        self, length: float, edge: float, rng: np.random.Generator
    ) -> tuple[Floats, Floats]:
        """Return steps and turns: corners at random distances, the heading drawn back to 0."""
        straight = max(0.7 * self.opening_mm, min(0.02 * self.length_mm, 1.5), 0.02)
        count = max(2, int(np.ceil(length / straight)))
        legs = rng.uniform(0.6, 1.4, count)
        legs *= length / legs.sum()
        heading = np.zeros(count)
        push = rng.normal(size=count) * 0.5 * self.meander
        for i in range(1, count):
            heading[i] = 0.45 * heading[i - 1] + np.sqrt(1 - 0.45**2) * push[i]
        turns = np.clip(np.diff(heading, prepend=heading[0]), -0.9, 0.9)
        # Stations between the corners follow the surface; not nearer than the mitre needs.
        parts = np.maximum(1, np.ceil(legs / max(edge, 0.5 * self.opening_mm))).astype(int)
        first = np.concatenate([[0], np.cumsum(parts)[:-1]])
        spread = np.zeros(int(parts.sum()))
        spread[first] = turns
        return np.repeat(legs / parts, parts), spread

    def _taper(self, v: Floats, along: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Return width and depth (n,) at positions `v` from -1 to 1."""
        uneven = smooth_noise(along, max(0.08 * self.length_mm, 2 * self.opening_mm), rng)
        rough = np.clip(0.8 + 0.2 * uneven, 0.35, 1.0)
        width = (1 - np.abs(v) ** 1.5) ** 0.7 * rough
        return self.opening_mm * (TIP + (1 - TIP) * width), self.depth_mm * (
            TIP + (1 - TIP) * (1 - v**4)
        )

    def _sweep(self, track: Track, width: Floats, depth: Floats) -> Cutter:
        """Sweep the section: a V up to a little above the skin, then upright walls."""
        rise = float(np.clip(0.3 * self.depth_mm, 0.05, 0.4))
        lip = 0.05 * depth
        left = np.cross(track.normals, track.directions)
        mitre = 1 / np.cos(0.5 * np.clip(track.turn_rad, -1.2, 1.2))
        reach = (0.5 * width * (1 + lip / depth) * mitre)[:, None] * left
        up = track.normals
        low = track.points_mm + lip[:, None] * up
        high = track.points_mm + rise * up
        floor = track.points_mm - depth[:, None] * up
        section = np.stack([floor, low - reach, high - reach, high + reach, low + reach], axis=1)
        edge = (0.5 * width * mitre)[:, None] * left
        skin = [track.points_mm, track.points_mm - edge, track.points_mm + edge]
        return Cutter(
            removed=_swept(section),
            added=None,
            skin_mm=np.concatenate(skin),
            normals=np.concatenate([up, up, up]),
            height_mm=np.concatenate([-depth, np.zeros(2 * len(depth))]),
            above_mm=np.concatenate([high - reach, high + reach]),
        )


def _swept(section: Floats) -> Solid:
    """Join convex sections (n, c, 3), counter-clockwise seen from ahead, to a closed solid."""
    n, c, _ = section.shape
    node = np.arange(n * c).reshape(n, c)
    beside = np.roll(node, -1, axis=1)
    a, b = node[:-1].ravel(), beside[:-1].ravel()
    d, e = node[1:].ravel(), beside[1:].ravel()
    sides = np.concatenate([np.stack([a, b, e], 1), np.stack([a, e, d], 1)])
    fan = np.stack([np.zeros(c - 2, np.int64), np.arange(1, c - 1), np.arange(2, c)], 1)
    caps = np.concatenate([fan[:, ::-1], fan + node[-1, 0]])
    faces = np.concatenate([sides, caps])
    solid = Solid(vertices_mm=section.reshape(-1, 3), faces=faces.astype(np.int32))
    if solid.volume_mm3 < 0:
        return Solid(vertices_mm=solid.vertices_mm, faces=solid.faces[:, ::-1].copy())
    return solid
