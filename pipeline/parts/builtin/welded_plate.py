"""A butt weld: a steel plate with a rippled bead along x on its upper side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.builtin.sheet import close_grid
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from quantity import quantity

DEFAULT_FACET_UM = 20.0
MOST_CELLS = 300_000
LEAST_TOE_RAD = np.deg2rad(34.0)
"""A flatter toe is no feature edge of the mesh (creases begin at 32°), and flaws along the toe
would find no place."""

CRESCENT = 0.2
"""How far a ripple's middle runs ahead of its ends, over the bead's width: the shape of the weld
pool's rear, which is a half circle (0.5) in slow welding and flatter in the usual."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class WeldedPlate:
    """Sizes of the plate and its bead, mm. The weld runs along x; the top is at z = thickness.

    ISO 5817 limits the bead's height to 1 mm + 0.1 (level B), 0.15 (C), 0.25 (D) of its width.
    """

    length_mm: float = quantity(
        "size along x, the weld", unit="mm", low=10.0, high=2000.0, default=160.0
    )
    width_mm: float = quantity("size along y", unit="mm", low=10.0, high=2000.0, default=120.0)
    thickness_mm: float = quantity(
        "distance from underside to top", unit="mm", low=1.0, high=100.0, default=8.0
    )
    bead_width_mm: float = quantity(
        "distance between the bead's toes", unit="mm", low=1.0, high=60.0, default=10.0
    )
    bead_height_mm: float = quantity(
        "height of the bead over the plate", unit="mm", low=0.2, high=20.0, default=2.0
    )
    ripple_pitch_mm: float = quantity(
        "distance of the ripples along x", unit="mm", low=0.3, high=20.0, default=2.5
    )
    ripple_height_mm: float = quantity(
        "amplitude of the ripples on the crown", unit="mm", low=0.0, high=3.0, default=0.08
    )


PARAMETERS = WeldedPlate


def bead_mm(plate: WeldedPlate, x_mm: Floats, y_mm: Floats) -> Floats:
    """Height of the bead over the plate: a circular arc with crescent ripples; 0 beside it."""
    half, height = plate.bead_width_mm / 2, plate.bead_height_mm
    radius = (half**2 + height**2) / (2 * height)
    inside = np.minimum(np.abs(y_mm), half)
    crown = np.sqrt(radius**2 - inside**2) - (radius - height)
    crescent = x_mm + CRESCENT * plate.bead_width_mm * (1 - (inside / half) ** 2)
    waves = np.cos(2 * np.pi * crescent / plate.ripple_pitch_mm)
    return np.asarray(np.maximum(crown, 0.0) * (1 + plate.ripple_height_mm / height * waves))


def make(plate: WeldedPlate, facet_um: float | None) -> Part:
    """Tessellate the plate with facets of the bead within `facet_um` of the true surface.

    Regions: ``outer`` (the upper side), ``bead``, ``toe`` (the plate beside the bead, half its
    width far), ``plate`` (the upper side beside the bead), ``side``, ``bottom``.
    """
    source = "builtin:welded_plate"
    half, height = plate.bead_width_mm / 2, plate.bead_height_mm
    if 2 * plate.bead_width_mm > plate.width_mm:
        raise PartError(
            source, f"bead_width_mm = {plate.bead_width_mm:g} doesn't fit the plate",
            "allowed: up to half the plate's width",
        )  # fmt: skip
    if plate.ripple_height_mm > 0.2 * height:
        raise PartError(
            source, f"ripple_height_mm = {plate.ripple_height_mm:g} on a bead {height:g} high",
            "allowed: up to a fifth of the bead's height",
        )  # fmt: skip
    toe = 2 * np.arctan(height / half) * (1 - plate.ripple_height_mm / height)
    if not LEAST_TOE_RAD <= toe <= np.pi / 2:
        raise PartError(
            source,
            f"bead_height_mm = {height:g} on a width of {2 * half:g} makes a toe of "
            f"{np.degrees(toe):.0f} degrees",
            "allowed: 34 to 90 degrees, so about 0.31 to 1 times half the width",
        )
    facet = (DEFAULT_FACET_UM if facet_um is None else facet_um) / 1000
    count, across = _cells(plate, facet)
    y_bead = np.linspace(-half, half, across + 1)
    beside = np.array([0.5, 1.5]) * half + half
    edge = plate.width_mm / 2
    beside = np.concatenate([beside[beside < 0.9 * edge], [edge]])
    y = np.concatenate([-beside[::-1], y_bead, beside])
    if count * len(y) > MOST_CELLS:
        raise PartError(
            source, f"facet_um = {1000 * facet:g} takes {count * len(y)} cells",
            f"coarser facets or a shorter plate, allowed: {MOST_CELLS} cells",
        )  # fmt: skip
    x = np.linspace(-plate.length_mm / 2, plate.length_mm / 2, count + 1)
    grid_x, grid_y = np.meshgrid(x, y, indexing="ij")
    lift = bead_mm(plate, grid_x, grid_y)
    top = np.stack([grid_x, grid_y, plate.thickness_mm + lift], axis=-1)
    bottom = np.stack([grid_x, grid_y, np.zeros_like(lift)], axis=-1)
    vertices, faces, side = close_grid(top, bottom)
    centre = np.abs(vertices[faces][:, :, 1].mean(axis=1))
    upper = side == 0
    return Part(
        name="welded_plate",
        vertices_mm=vertices,
        faces=faces,
        regions={
            "outer": upper,
            "bead": upper & (centre < half),
            "toe": upper & (centre > half) & (centre < 1.5 * half),
            "plate": upper & (centre > half),
            "side": side >= 2,
            "bottom": side == 1,
        },
        source=source,
    )


def _cells(plate: WeldedPlate, facet_mm: float) -> tuple[int, int]:
    """Return how many cells along and across keep the bead's facets within `facet_mm`.

    Linear interpolation on right triangles with legs a, b errs by at most
    (a² |f_xx| + 2 a b |f_xy| + b² |f_yy|) / 8; the derivatives are those of `bead_mm` over one
    ripple, by differences. Without ripples a is free.
    """
    half = plate.bead_width_mm / 2
    x = np.linspace(0.0, plate.ripple_pitch_mm, 129)
    y = np.linspace(-0.999 * half, 0.999 * half, 513)
    lift = bead_mm(plate, *np.meshgrid(x, y, indexing="ij"))
    f_x, f_y = np.gradient(lift, x, y, edge_order=2)
    f_xx, f_xy = np.gradient(f_x, x, y, edge_order=2)
    f_yy = np.gradient(f_y, y, axis=1, edge_order=2)
    xx, xy, yy = (float(np.abs(f).max()) for f in (f_xx, f_xy, f_yy))
    legs = 2.0 if plate.ripple_height_mm > 0 else 50.0  # a over b
    b = np.sqrt(8 * facet_mm / (legs**2 * xx + 2 * legs * xy + yy))
    across = 2 * max(8, int(np.ceil(half / b)))
    return int(np.ceil(plate.length_mm / min(legs * b, 10.0))), across
