"""Corrosion: a field of pits that started at different times and grew, on thinned skin."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.shape.outline import outline
from defects.shape.patch import Patch, dig
from defects.shape.track import Track
from defects.surface.surface import Site, Surface
from quantity import quantity

Floats = NDArray[np.float64]

WARP = 0.14
"""Standard deviation of the warp in radii: outlines of 1 to 2 times their least radius, the
roundness of pits in ASTM G46's figure 2 (elliptical to irregular)."""

MOST_CELLS = 9_000
"""Cells of a field's mesh: with more a specimen takes longer than one with a dent twice over."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Corrosion(Kind):
    """A corroded place.

    Pits start ever more often as the film on the skin breaks down (ages are squares of even draws)
    and grow as a power of their age,

        depth_i = depth (age_i / exposure)^growth,

    the law of Romanoff (NBS Circular 579, 1957) for buried and atmospheric steel with exponents of
    0.2 to 0.8. Each is a paraboloid `width_ratio` times as wide as deep (ASTM G46: wide, shallow
    pits to narrow, deep ones); where pits meet the deeper one counts. Between them the skin is
    thinned evenly by `loss_ratio` times the depth within an uneven outline.
    """

    name: ClassVar[str] = "corrosion"
    class_id: ClassVar[int] = 8

    length_mm: float = quantity(
        "axis of the field along the heading", unit="mm", low=1.0, high=300.0, typical=(6.0, 20.0)
    )
    aspect: float = quantity("other axis over `length_mm`", low=0.2, high=1.0, typical=(0.5, 1.0))
    depth_mm: float = quantity(
        "depth of the oldest pit", unit="mm", low=0.01, high=10.0, typical=(0.15, 0.8)
    )
    growth: float = quantity("exponent of the growth", low=0.2, high=0.8, typical=(0.3, 0.6))
    width_ratio: float = quantity(
        "diameter of a pit over its depth", low=1.0, high=12.0, typical=(2.5, 6.0)
    )
    cover: float = quantity(
        "area of all pits over the field's", low=0.05, high=2.0, typical=(0.4, 1.0)
    )
    loss_ratio: float = quantity(
        "even loss over the depth of the oldest pit", low=0.0, high=0.5, typical=(0.03, 0.15)
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Draw the pits and build the one solid that they and the even loss take away."""
        a, b = self.length_mm / 2, self.length_mm * self.aspect / 2
        places, deep = self._pits(a, b, rng)
        wide = deep * self.width_ratio / 2
        reach = (a + float(wide.max()) * 1.1, b + float(wide.max()) * 1.1)
        finest = np.sqrt(4 * reach[0] * reach[1] / MOST_CELLS)
        step = max(float(np.median(wide)) / 8, float(finest))
        way = np.linspace(0.0, reach[0], int(np.ceil(reach[0] / step)) + 1)[1:]
        across = np.linspace(0.0, reach[1], int(np.ceil(reach[1] / step)) + 1)[1:]
        steps, straight = np.diff(way, prepend=0.0), np.zeros(len(way))
        track = Track.walked(
            surface, site.position_mm, site.direction(), (steps, straight), (steps, straight)
        )
        patch = Patch.strip(surface, track.points_mm, track.directions, track.along_mm, across)
        x, y = patch.first, patch.second
        # Uneven pits: the paraboloids are drawn on a field that is warped by waves of their size.
        size_mm = float(np.median(wide))
        warp = [WARP * size_mm * _waves(x, y, 2.5 * size_mm, rng) for _ in range(2)]
        depth = np.full(len(x), -np.inf)
        for (px, py), d, r in zip(places, deep, wide, strict=True):
            square = ((x + warp[0] - px) ** 2 + (y + warp[1] - py) ** 2) / r**2
            np.maximum(depth, d * (1 - square), out=depth)
        ring = outline(np.arctan2(y / b, x / a), 0.12, rng)
        share = np.hypot(x / a, y / b) / (0.92 * ring)
        loss = self.loss_ratio * self.depth_mm
        depth = np.maximum(depth, loss * (1 - share**8))
        height = np.minimum(-depth, 0.3 * self.depth_mm)
        return dig(patch, height, height < 0, self.depth_mm)

    def _pits(self, a: float, b: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Return places (n, 2) and depths (n,) of the pits, the oldest, in the middle, first."""
        # A pit's mean area over π: radius² with ages squared, the integral of t^(4 growth).
        mean = (self.depth_mm * self.width_ratio / 2) ** 2 / (1 + 4 * self.growth)
        number = 1 + int(np.clip(rng.poisson(self.cover * a * b / mean), 2, 300))
        age = np.square(rng.uniform(size=number))
        age[0] = 1.0
        # Older pits lie further in, where the film broke down first.
        radius = np.sqrt(rng.uniform(size=number)) * (1 - 0.25 * age)
        radius[0] *= 0.3
        angle = rng.uniform(0, 2 * np.pi, number)
        places = np.stack([a * radius * np.cos(angle), b * radius * np.sin(angle)], axis=1)
        return places, self.depth_mm * np.maximum(age, 0.05) ** self.growth


def _waves(x: Floats, y: Floats, length_mm: float, rng: np.random.Generator) -> Floats:
    """Return a smooth random field of unit variance at points (n,), waves of `length_mm` and up."""
    count = 12
    angle, phase = rng.uniform(0, 2 * np.pi, (2, count))
    wave = 2 * np.pi / (length_mm * rng.uniform(1.0, 3.0, count))
    at = np.multiply.outer(x, wave * np.cos(angle)) + np.multiply.outer(y, wave * np.sin(angle))
    return np.asarray(np.cos(at + phase).sum(axis=1) * np.sqrt(2 / count))
