"""Missing feature: a round hole that wasn't drilled, or was drilled with the wrong diameter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter, Solid
from defects.kind import Kind
from defects.seats.holes import Hole, nearest_hole
from defects.seats.seat import HoleRim, Seat
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity

Floats = NDArray[np.float64]

SINK = 0.02
"""How far a plug's wall stands into the hole's wall, in radii: clearly, for the boolean."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MissingFeature(Kind):
    """A hole of the part with another diameter, or none.

    A missing or too small hole is filled from its rim. A blind hole is filled to its bottom, and a
    through hole to `depth_share` of its depth: the far side then shows a blind hole, like that of
    an unfinished drilling from there. A too large hole is widened about its axis.
    """

    name: ClassVar[str] = "missing_feature"
    class_id: ClassVar[int] = 14
    seat: ClassVar[Seat] = HoleRim()

    ratio: float = quantity(
        "diameter over the nominal one: 0 is no hole; 0.98 to 1.02 is no flaw and refused",
        low=0.0,
        high=2.0,
        typical=(0.0, 0.0),
    )
    depth_share: float = quantity(
        "filled depth of a through hole, over its depth",
        low=0.2,
        high=0.9,
        typical=(0.5, 0.8),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the plug or the drill; nothing is left open, so nothing is drawn."""
        if 0.98 < self.ratio < 1.02:
            raise SiteError("missing_feature: a ratio of 0.98 to 1.02 is no flaw")
        hole = nearest_hole(surface, site.position_mm)
        rim = _rim(hole)
        return self._widened(hole, rim) if self.ratio > 1 else self._filled(hole, rim)

    def _widened(self, hole: Hole, rim: Floats) -> Cutter:
        share = self.ratio * hole.bore_mm / hole.radius_mm
        wide = hole.centre_mm + share * (rim - hole.centre_mm)
        margin = 0.1 * hole.radius_mm
        depth = hole.depth_mm + margin if hole.through else 0.97 * hole.depth_mm
        removed = _prism([wide + margin * hole.axis, wide - depth * hole.axis])
        # The skin that goes is the ring around the rim; the flaw is as deep as the hole.
        return Cutter(
            removed=removed, added=None, skin_mm=wide,
            normals=np.repeat(hole.axis[None], len(wide), axis=0),
            height_mm=np.full(len(wide), -hole.depth_mm), above_mm=wide + margin * hole.axis,
        )  # fmt: skip

    def _filled(self, hole: Hole, rim: Floats) -> Cutter:
        sink = SINK * hole.radius_mm
        outward = (rim - hole.centre_mm) / hole.radius_mm
        depth = self.depth_share * hole.depth_mm if hole.through else hole.depth_mm + sink
        below = rim + sink * (outward - hole.axis)
        rings = [rim, below, below - (depth - sink) * hole.axis]
        if self.ratio > 0:
            share = self.ratio * hole.bore_mm / hole.radius_mm
            inner = hole.centre_mm + share * (rim - hole.centre_mm)
            plug = _tube(rings, [inner, inner - depth * hole.axis])
        else:
            plug = _prism(rings)
        # The mouth is closed level with the face around it; the hole's floor rises by its depth.
        middle = hole.centre_mm[None]
        return Cutter(
            removed=None, added=plug, skin_mm=middle - depth * hole.axis,
            normals=hole.axis[None], height_mm=np.array([depth]),
            above_mm=np.zeros((0, 3)),
        )  # fmt: skip


def _rim(hole: Hole) -> Floats:
    """Return the rim's corners (n, 3), counter-clockwise about the axis."""
    rim = hole.chain.points_mm[:-1]
    turn = np.cross(rim[0] - hole.centre_mm, rim[1] - hole.centre_mm) @ hole.axis
    return np.asarray(rim if turn > 0 else rim[::-1])


def _prism(rings: list[Floats]) -> Solid:
    """Close a stack of rings (n, 3), counter-clockwise from above and from the top down."""
    n = len(rings[0])
    top, bottom = rings[0].mean(axis=0), rings[-1].mean(axis=0)
    centre = np.full(n, len(rings) * n)
    first = np.arange(n)
    after = np.roll(first, -1)
    last = (len(rings) - 1) * n
    faces = [
        np.stack([centre, first, after], 1),
        np.stack([centre + 1, last + after, last + first], 1),
    ]
    faces += [_wall(level * n, (level + 1) * n, n) for level in range(len(rings) - 1)]
    return Solid(
        vertices_mm=np.concatenate([*rings, top[None], bottom[None]]),
        faces=np.concatenate(faces).astype(np.int32),
    )


def _tube(outer: list[Floats], inner: list[Floats]) -> Solid:
    """Close a stack of rings around a stack of rings with the same ends."""
    n, many = len(outer[0]), len(outer)
    faces = [_wall(level * n, (level + 1) * n, n) for level in range(many - 1)]
    faces.append(_wall(many * n, (many + 1) * n, n)[:, ::-1])
    faces.append(_wall(many * n, 0, n))
    faces.append(_wall((many - 1) * n, (many + 1) * n, n))
    return Solid(
        vertices_mm=np.concatenate([*outer, *inner]),
        faces=np.concatenate(faces).astype(np.int32),
    )


def _wall(upper: int, lower: int, n: int) -> NDArray[np.int64]:
    """Join two rings of n corners, counter-clockwise from above, facing away from the axis."""
    first = np.arange(n)
    after = np.roll(first, -1)
    a, b, c, d = upper + first, upper + after, lower + after, lower + first
    return np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)])
