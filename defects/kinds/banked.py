"""Bank: a flaw taken from a real scan, put on another part with variations."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter
from defects.flaw_bank import FlawBank, Relief
from defects.kind import Kind
from defects.shape.lid import reshape
from defects.shape.patch import Patch, dig
from defects.shape.track import Track
from defects.surface.surface import Site, SiteError, Surface
from quantity import Quantity, quantity

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MOST_CELLS = 9_000
"""Cells of a flaw's mesh, as of a corroded field's."""
FLOOR = 0.02
"""Share of the greatest height by which the lid goes under the skin beyond the flaw, and by which
a hollow's rim lies under it, so that no face of the flaw nearly coincides with the skin."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Banked(Kind):
    """A relief of a bank made by `flawforge flaw extract`, laid on the skin.

    The relief's lattice is laid on the part along geodesics of its skin, along the heading and then
    to both sides. Each node is moved along the local normal by

        h = scale height_ratio relief(u / scale, v / scale),

    with the geodesic distances u and v. `mirror` reverses v, and `bend_deg` turns the middle line
    over the flaw's length. Between nodes the relief is a bicubic spline.
    """

    name: ClassVar[str] = "bank"
    class_id: ClassVar[int] = 15

    which: float = quantity(
        "place of the flaw in the bank: 0 the first file by name, towards 1 the last",
        low=0.0,
        high=1.0,
        typical=(0.0, 1.0),
    )
    scale: float = quantity(
        "factor on all lengths, height included", low=0.05, high=20.0, typical=(0.7, 1.4)
    )
    height_ratio: float = quantity(
        "further factor on the height", low=0.05, high=20.0, typical=(0.7, 1.4)
    )
    mirror: float = quantity(
        "1: mirrored; in a recipe, true mirrors every second flaw",
        low=0,
        high=1,
        typical=(0, 1),
        whole=True,
    )
    bend_deg: float = quantity(
        "angle by which the middle line turns over the flaw's length",
        unit="°",
        low=-180.0,
        high=180.0,
        typical=(-10.0, 10.0),
    )
    bank: FlawBank | None = None

    @classmethod
    def scaled_by_tier(cls, size: Quantity) -> bool:
        """Whether a severity tier's scale acts on a size: here on `scale` alone."""
        return size.name == "scale"

    @property
    def relief(self) -> Relief:
        """The relief that was drawn.

        Raises
        ------
        SiteError
            Without a bank.
        """
        if self.bank is None or not self.bank.reliefs:
            raise SiteError("bank: no bank of flaws is given")
        return self.bank.at(self.which)

    @property
    def source(self) -> str:
        """Name of the relief."""
        return self.relief.name

    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Lay the lattice on the skin and build what goes and what comes; nothing is drawn."""
        height, mask, step = self._shape(sagitta_mm)
        turn = np.deg2rad(self.bend_deg) / ((len(height) - 1) * step[0])
        patch = spread(surface, site, (len(height), len(height[0])), step, turn)
        peak = float(np.abs(height[mask]).max())
        floor = FLOOR * peak
        margin = float(np.clip(0.2 * peak, 0.003, 0.05))
        touched = _whole(_any_corner(mask), grow=True)
        lid = patch.cells(touched)
        if (height[mask] <= 0).all():
            under = np.where(mask, np.minimum(height, -floor), floor)
            return dig(lid, under.ravel(), mask.ravel(), margin)
        over = np.where(mask, height, -floor).ravel()
        inner = _whole(_every_corner(mask), grow=False)
        if (height[mask] >= 0).all() or not inner.any():
            return reshape(lid, np.where(mask.ravel(), np.maximum(over, floor), over), None, None,
                           margin)  # fmt: skip
        pocket = np.minimum(over, 0.0) - margin
        return reshape(lid, over, patch.cells(inner), pocket, margin)

    def _shape(self, sagitta: float) -> tuple[Floats, Bools, tuple[float, float]]:
        """Return heights and mask on a lattice as fine as it must be, and its steps."""
        from scipy.interpolate import RectBivariateSpline, RegularGridInterpolator

        relief = self.relief
        known = relief.height_mm[:, ::-1] if self.mirror else relief.height_mm
        inside = relief.footprint[:, ::-1] if self.mirror else relief.footprint
        factor = self.scale * self.height_ratio
        size = np.array(known.shape)
        # A facet's error is at most an eighth of the second differences along and across it.
        bend = sum(np.abs(np.diff(known, 2, axis=axis)).max() for axis in (0, 1)) * factor
        fine = np.clip(np.sqrt(bend / (8 * sagitta)), 1.0, np.sqrt(MOST_CELLS / size.prod()))
        count = 2 * np.maximum(((size - 1) * fine / 2).astype(int), 4) + 1
        # 64 bits and contiguous, as the spline wants it
        axes = [np.arange(n, dtype=np.float64) for n in known.shape]
        at = [np.linspace(0.0, n - 1.0, k) for n, k in zip(known.shape, count, strict=True)]
        # here, since most runs never draw from a bank

        height = factor * RectBivariateSpline(*axes, known, kx=3, ky=3, s=0)(*at)
        share = RegularGridInterpolator(axes, inside.astype(np.float64))
        mask = share(np.stack(np.meshgrid(*at, indexing="ij"), axis=-1)) >= 0.5
        mask[[0, -1]] = mask[:, [0, -1]] = False
        length = relief.pitch_mm * self.scale * (size - 1) / (count - 1)
        return np.asarray(height), np.asarray(mask), (float(length[0]), float(length[1]))


def spread(
    surface: Surface,
    site: Site,
    nodes: tuple[int, int],
    step_mm: tuple[float, float],
    turn_per_mm: float = 0.0,
) -> Patch:
    """Lay a lattice on the skin, its middle node at a site, its rows across the heading.

    Parameters
    ----------
    nodes
        Along and across, both odd.
    step_mm
        Along and across.
    turn_per_mm
        Turn of the middle line to the left, rad/mm.

    Raises
    ------
    SiteError
        When it crosses an edge of the part or folds.
    """
    steps = np.full(nodes[0] // 2, step_mm[0])
    turns = steps * turn_per_mm
    track = Track.walked(
        surface, site.position_mm, site.direction(), (steps, turns), (steps, -turns)
    )
    across = step_mm[1] * np.arange(1.0, nodes[1] // 2 + 1)
    return Patch.strip(surface, track.points_mm, track.directions, track.along_mm, across)


def _any_corner(mask: Bools) -> Bools:
    return np.asarray(mask[1:, 1:] | mask[1:, :-1] | mask[:-1, 1:] | mask[:-1, :-1])


def _every_corner(mask: Bools) -> Bools:
    return np.asarray(mask[1:, 1:] & mask[1:, :-1] & mask[:-1, 1:] & mask[:-1, :-1])


def _whole(cells: Bools, *, grow: bool) -> Bools:
    """Return cells of which no two meet at a corner alone: by more of them, or by fewer."""
    cells = cells.copy()
    while True:
        a, b, c, d = cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:]
        falling, rising = a & d & ~b & ~c, b & c & ~a & ~d
        if not (falling.any() or rising.any()):
            return cells
        if grow:
            b |= falling
            a |= rising
        else:
            d &= ~falling
            c &= ~rising
