"""Dent: a smooth elliptic hollow with a rim of displaced material."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.shape.lid import eased, reshape
from defects.shape.patch import Patch
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity

Floats = NDArray[np.float64]


THIN = 0.2
"""Thickness over span below which a plate bends as a thin one, with sections that stay normal to
its middle surface and no change of thickness (Timoshenko and Woinowsky-Krieger, Theory of Plates
and Shells, chapter 1: small against the span; 1/5 is the usual limit)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Dent(Kind):
    r"""A dent whose profile is one polynomial, hollow and rim alike.

    With the elliptic radius ratio rho (1 where the hollow meets the skin) the surface stands at

        w(rho) = -depth (1 - rho²) (1 - rho²/Q)

    over the skin, along the local normal: a hollow for rho < 1, a rim for 1 < rho < q = sqrt(Q),
    and it meets the skin at an angle at both ends, so that there is no tangential contact. The
    rim's crest is depth (Q - 1)² / (4 Q), so a rim of `rim_ratio` times the depth has
    q = s + sqrt(s² + 1), s = sqrt(rim_ratio). Over a plane, with half-axes a and b:

        removed = pi a b depth (1/2 - 1/(6 Q)),   added = pi a b depth (Q - 1)³ / (6 Q).

    A thin sheet is bent, not pressed: where its thickness is at most `THIN` of the shorter axis
    its far skin moves by as much as the near one under the hollow.
    """

    name: ClassVar[str] = "dent"
    class_id: ClassVar[int] = 1

    length_mm: float = quantity(
        "axis of the hollow along the heading, at the level of the skin",
        unit="mm", low=0.2, high=200.0, typical=(3.0, 20.0),
    )
    aspect: float = quantity("other axis over `length_mm`", low=0.1, high=1.0, typical=(0.5, 1.0))
    depth_mm: float = quantity(
        "depth at the centre", unit="mm", low=0.005, high=20.0, typical=(0.1, 0.8)
    )
    rim_ratio: float = quantity(
        "height of the rim's crest over the depth", low=0.01, high=0.5, typical=(0.03, 0.15)
    )

    @property
    def outer_ratio(self) -> float:
        """Return q, the radius ratio at which the rim ends."""
        s = np.sqrt(self.rim_ratio)
        return float(s + np.sqrt(s * s + 1.0))

    def height_mm(self, rho: Floats) -> Floats:
        """Return the surface over the skin at radius ratios `rho`; below zero past the rim."""
        square = np.square(rho)
        return -self.depth_mm * (1.0 - square) * (1.0 - square / self.outer_ratio**2)

    @property
    def removed_mm3(self) -> float:
        """Return the volume removed from a flat part."""
        area = np.pi / 4 * self.length_mm**2 * self.aspect
        return float(area * self.depth_mm * (0.5 - 1 / (6 * self.outer_ratio**2)))

    @property
    def added_mm3(self) -> float:
        """Return the volume of the rim on a flat part."""
        area = np.pi / 4 * self.length_mm**2 * self.aspect
        big = self.outer_ratio**2
        return float(area * self.depth_mm * (big - 1) ** 3 / (6 * big))

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the pocket and its lid; nothing is left open, so nothing is drawn."""
        a, b = self.length_mm / 2, self.length_mm * self.aspect / 2
        if self.depth_mm > b:
            raise SiteError(f"dent: a depth of {self.depth_mm} mm over a half-width of {b} mm")
        q = self.outer_ratio
        # An edge of the part in the way is found here, before all the rest is built.
        bend = max(surface.curvature_per_mm(site, q * a, self.aspect, whole=True), 1e-9)
        margin = float(np.clip(0.2 * self.depth_mm, 0.005, 0.05))
        lid = self._patch(surface, site, sagitta_mm, bend)
        height = self.height_mm(lid.first)
        share = np.clip((lid.first - 1.0) / (q - 1.0), 0.0, 1.0)
        thickness = _thickness(surface, site, lid, THIN * b)
        if thickness is not None:
            margin = min(margin, 0.25 * float(thickness.min()))
        floor = eased(height, share, margin)
        return reshape(lid, height, lid, floor, margin, sagitta_mm, share, thickness)

    def _patch(
        self,
        surface: Surface,
        site: Site,
        sagitta: float,
        bend_per_mm: float,
    ) -> Patch:
        """Spread a disk whose facets stand off by `sagitta`, up to the rim's end and beyond."""
        a, b = self.length_mm / 2, self.length_mm * self.aspect / 2
        last = self.outer_ratio
        # |w''| <= 10 depth along the radius, |w'| <= 2 depth across it; at a crease of a coarse
        # mesh, where the curvature has no bound, the facets needn't be finer than the mesh is.
        edge_mm = max(float(np.sqrt(8 * sagitta / bend_per_mm)), 0.15, a / 50)
        ring = max(0.0025, min(np.sqrt(0.8 * sagitta / self.depth_mm), edge_mm / a, 0.1))
        sector = max(
            0.008, min(np.sqrt(2 * sagitta / self.depth_mm), edge_mm / (last * a), 0.13)
        )
        inner = np.linspace(0.0, 1.0, int(np.ceil(1 / ring)) + 1)[1:]
        rim = np.linspace(1.0, last, max(3, int(np.ceil((last - 1) / ring))) + 1)[1:]
        # A multiple of 16: the axes are among the headings, and cells make large blocks.
        angles = np.linspace(0, 2 * np.pi, 16 * int(np.ceil(np.pi / 8 / sector)), endpoint=False)
        outline = 1 / np.hypot(np.cos(angles) / a, np.sin(angles) / b)
        skirt = last + 0.06 * np.array([1.0, 2.0])
        return Patch.disk(surface, site, outline, np.concatenate([inner, rim, skirt]))


def _thickness(surface: Surface, site: Site, lid: Patch, reach_mm: float) -> Floats | None:
    """Return the sheet's thickness (n,) under a patch; None where it is no sheet that thin.

    From `reach_mm` under the skin the far skin is the nearest one if it is less than twice as far.
    """

    def opposite(skin: Floats, normals: Floats, depth_mm: float) -> tuple[Floats, Floats]:
        onto, facing, _ = surface.project(skin - depth_mm * normals)
        return -np.sum((onto - skin) * normals, axis=1), np.sum(facing * normals, axis=1)

    thickness, facing = opposite(site.position_mm[None], site.normal[None], reach_mm)
    middle = float(thickness[0])
    if facing[0] > -0.9 or not 0 < middle <= 2 * reach_mm:
        return None
    thickness, facing = opposite(lid.skin_mm, lid.normals, middle)
    even = (facing < -0.9) & (np.abs(thickness - middle) < 0.3 * middle)
    return thickness if even.all() else None
