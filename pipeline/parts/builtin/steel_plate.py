"""A rolled heavy steel plate: mill edges rounded along the rolling direction x, ends sheared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.builtin.round_profile import arc_steps
from pipeline.parts.builtin.sheet import close_grid
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from quantity import quantity

DEFAULT_FACET_UM = 20.0
MOST_CELLS = 300_000


@dataclass(frozen=True, kw_only=True, slots=True)
class SteelPlate:
    """Sizes of the plate, mm. The rolling direction is x; the top stands at z = thickness."""

    length_mm: float = quantity(
        "size along x, the rolling direction", unit="mm", low=20.0, high=4000.0, default=600.0
    )
    width_mm: float = quantity("size along y", unit="mm", low=20.0, high=4000.0, default=400.0)
    thickness_mm: float = quantity(
        "distance from underside to top", unit="mm", low=3.0, high=200.0, default=30.0
    )
    edge_radius_mm: float = quantity(
        "radius of the rolled edges", unit="mm", low=0.5, high=100.0, default=6.0
    )
    wave_height_mm: float = quantity(
        "amplitude of the flatness waves at the edges; 0 is flat",
        unit="mm", low=0.0, high=10.0, default=0.0,
    )
    wave_length_mm: float = quantity(
        "length of the flatness waves along x", unit="mm", low=100.0, high=4000.0, default=350.0
    )


PARAMETERS = SteelPlate


def flatness_mm(
    plate: SteelPlate, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Lift of the whole plate by its edge waves, mm: strongest at the mill edges, none midway."""
    edge = (2.0 * y_mm / plate.width_mm) ** 2
    return plate.wave_height_mm * edge * np.sin(2.0 * np.pi * x_mm / plate.wave_length_mm)


def make(plate: SteelPlate, facet_um: float | None) -> Part:
    """Tessellate the plate with facets within `facet_um` of the true surface.

    Regions: ``outer`` (the upper side: flat face and its rolled edges), ``face`` (the flat face
    alone), ``edge`` (the rolled edges of the upper side), ``side``, ``bottom``.
    """
    source = "builtin:steel_plate"
    radius, thickness = plate.edge_radius_mm, plate.thickness_mm
    if 2.0 * radius > 0.98 * thickness or 2.0 * radius > 0.5 * plate.width_mm:
        raise PartError(
            source,
            f"edge_radius_mm = {radius:g} doesn't fit the plate",
            "allowed: below half the thickness and a quarter of the width",
        )
    facet_mm = (DEFAULT_FACET_UM if facet_um is None else facet_um) / 1000.0
    flat_mm = plate.width_mm / 2.0 - radius
    x, y_flat = _flat_knots(plate, flat_mm, 0.45 * facet_mm)
    if len(x) * len(y_flat) > MOST_CELLS:
        raise PartError(
            source,
            f"facet_um = {1000.0 * facet_mm:g} takes {len(x) * len(y_flat)} cells for these waves",
            f"coarser facets or gentler waves, allowed: {MOST_CELLS} cells",
        )
    # The wave's sagitta and the arc's add up on the rolled edges: half for each.
    share = 0.5 if plate.wave_height_mm > 0.0 else 1.0
    arc = np.linspace(0.0, np.pi / 2.0, 1 + arc_steps(radius, np.pi / 2.0, share * facet_mm))
    y_arc, drop = flat_mm + radius * np.sin(arc), radius * (1.0 - np.cos(arc))
    y = np.concatenate([-y_arc[:0:-1], y_flat, y_arc[1:]])
    y[0], y[-1] = -plate.width_mm / 2.0, plate.width_mm / 2.0
    z = np.concatenate([drop[:0:-1], np.zeros(len(y_flat)), drop[1:]])
    grid_x, grid_y = np.meshgrid(x, y, indexing="ij")
    lift = flatness_mm(plate, grid_x, grid_y)
    top = np.stack([grid_x, grid_y, thickness - z + lift], axis=-1)
    bottom = np.stack([grid_x, grid_y, z + lift], axis=-1)
    vertices, faces, side = close_grid(top, bottom)
    centre = np.abs(vertices[faces][:, :, 1].mean(axis=1))
    return Part(
        name="steel_plate",
        vertices_mm=vertices,
        faces=faces,
        regions={
            "outer": side == 0,
            "face": (side == 0) & (centre < flat_mm),
            "edge": (side == 0) & (centre >= flat_mm),
            "side": side >= 2,
            "bottom": side == 1,
        },
        source=source,
    )


def _flat_knots(
    plate: SteelPlate, flat_mm: float, facet_mm: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Grid lines along x and across the flat face that keep the waves within `facet_mm`.

    Linear interpolation on right triangles with legs a, b errs by at most
    (a² |f_xx| + 2 a b |f_xy| + b² |f_yy|) / 8; the second derivatives are those of
    `flatness_mm` at the mill edge. Flat plates get cells of up to 25 mm.
    """
    k, high = 2.0 * np.pi / plate.wave_length_mm, plate.wave_height_mm
    f_xx, f_xy, f_yy = high * k**2, 4.0 * high * k / plate.width_mm, 8.0 * high / plate.width_mm**2
    step_x = min(25.0, np.sqrt(4.0 * facet_mm / f_xx)) if high > 0.0 else 25.0
    step_y = 25.0
    while (step_x**2 * f_xx + 2.0 * step_x * step_y * f_xy + step_y**2 * f_yy) / 8.0 > facet_mm:
        step_y *= 0.8
    count_x = int(np.ceil(plate.length_mm / step_x))
    count_y = int(np.ceil(2.0 * flat_mm / step_y))
    return (
        np.linspace(-plate.length_mm / 2.0, plate.length_mm / 2.0, count_x + 1),
        np.linspace(-flat_mm, flat_mm, count_y + 1),
    )
