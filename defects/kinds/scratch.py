"""Scratch: a long groove whose material stands as a burr at its sides and ends."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.kind import Kind
from defects.shape.lid import eased, reshape
from defects.shape.patch import Patch
from defects.shape.thinning import filled
from defects.shape.track import Track, smooth_noise
from defects.surface.surface import Site, SiteError, Surface
from quantity import quantity

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Scratch(Kind):
    """A groove along a nearly straight path, with material piled up beside it.

    With the distance ratio rho (1 at the groove's edge: across the path over half the width;
    at the ends over the run-out, which is up to four widths long) the surface stands at

        w(rho) = -depth(s) (1 - rho^k)               for rho < 1,
        w(rho) = 4 burr t (1 - t), t = (rho - 1)/B   beyond

    over the skin, with k = `section` (1: V, 2: parabola) and B = `burr_width`. The depth varies
    along the path and the burr differs between the sides. Grooves and pile-up have the shape that
    scratch tests with a stylus leave (ASTM G171: the width is that between the edges; Williams,
    Tribology International 29 (1996) 675); handling scratches are 50 to 300 µm wide.
    """

    name: ClassVar[str] = "scratch"
    class_id: ClassVar[int] = 4

    length_mm: float = quantity(
        "length of the groove along the path", unit="mm", low=0.5, high=500.0, typical=(5.0, 40.0)
    )
    width_mm: float = quantity(
        "width of the groove at the level of the skin",
        unit="mm", low=0.02, high=10.0, typical=(0.05, 0.3),
    )
    depth_mm: float = quantity(
        "approximate greatest depth; the manifest records the exact depth",
        unit="mm", low=0.002, high=3.0, typical=(0.008, 0.06),
    )
    burr_ratio: float = quantity(
        "mean height of the burr over the depth", low=0.02, high=0.8, typical=(0.1, 0.4)
    )
    burr_width: float = quantity(
        "width of the burr on each side, over half the groove's width",
        low=0.2, high=2.0, typical=(0.4, 0.9),
    )
    burr_side: float = quantity(
        "-1: all burr to the right of the heading, 0: even, 1: all to the left",
        low=-0.95, high=0.95, typical=(-0.7, 0.7),
    )
    section: float = quantity("exponent k of the section", low=1.0, high=3.0, typical=(1.3, 2.2))
    bow_deg: float = quantity(
        "angle by which the path turns over its length",
        unit="°", low=-90.0, high=90.0, typical=(-12.0, 12.0),
    )

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Walk the path, spread a strip over it, and build the pocket and its lid."""
        a, half = self.width_mm / 2, self.length_mm / 2
        if self.depth_mm > self.width_mm or self.width_mm > self.length_mm / 2:
            raise SiteError("scratch: deeper than wide, or wider than half its length")
        end = 1.0 + self.burr_width
        out = min(2 * self.width_mm, half / 2)
        bend = max(surface.curvature_per_mm(site, half), 1e-9)
        edge = max(float(np.sqrt(8 * sagitta_mm / bend)), 0.1)
        fine = float(np.clip(np.sqrt(0.8 * sagitta_mm / self.depth_mm), 0.02, 0.12))
        burr = 1.0 + _ramp(self.burr_width, min(fine, self.burr_width / 8))
        skirt = end + 0.08 * self.burr_width * np.array([1.0, 2.0])
        across = a * filled(np.concatenate([_ramp(1.0, fine), burr, skirt]))
        coarse = min(edge, self.length_mm / 40, 3 * self.width_mm)
        run = half - out + out * np.concatenate([_ramp(1.0, fine), burr, skirt])
        way = np.concatenate([(half - out) * _ramp(1.0, coarse / (half - out)), run])
        way = filled(way)
        steps = np.diff(way, prepend=0.0)
        turn = np.deg2rad(self.bow_deg) * steps / self.length_mm
        track = Track.walked(
            surface, site.position_mm, site.direction(), (steps, turn), (steps, -turn)
        )
        patch = Patch.strip(surface, track.points_mm, track.directions, track.along_mm, across)
        u = patch.second / a
        rho = np.hypot(u, np.maximum(np.abs(patch.first) - (half - out), 0.0) / out)
        height = self._height(rho, u, patch.first, rng)
        margin = float(np.clip(0.3 * self.depth_mm, 0.003, 0.05))
        share = np.clip((rho - 1) / self.burr_width, 0, 1)
        return reshape(
            patch, height, patch, eased(height, share, margin), margin, sagitta_mm, share
        )

    def _height(self, rho: Floats, u: Floats, along: Floats, rng: np.random.Generator) -> Floats:
        v = along / (self.length_mm / 2)
        depth = (1 - 0.5 * np.minimum(v * v, 1.0)) * (
            1 + 0.08 * np.clip(smooth_noise(along, 5 * self.width_mm, rng), -2.5, 2.5)
        )
        groove = -self.depth_mm * depth * (1 - rho**self.section)
        uneven = np.clip(1 + 0.3 * smooth_noise(along, 2 * self.width_mm, rng), 0.3, 2.0)
        side = (1 + self.burr_side * np.tanh(2 * u)) * uneven
        t = (rho - 1.0) / self.burr_width
        arch = 4 * self.burr_ratio * self.depth_mm * depth * t * (1 - t)
        # Past the burr the lid stays shallow under the skin.
        burr = np.where(t < 1, arch * side, np.maximum(arch, -0.3 * self.depth_mm))
        return np.where(rho < 1, groove, burr)


def _ramp(length: float, step: float) -> Floats:
    """Return evenly spaced positions up to `length`, about `step` apart, without 0."""
    return np.linspace(0.0, length, max(2, int(np.ceil(length / step))) + 1)[1:]
