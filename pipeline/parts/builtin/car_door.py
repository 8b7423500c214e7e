"""The outer panel of a car door: stamped sheet with handle recess, feature lines and hem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.parts.builtin.adaptive_sheet import TooFineError, close_sheet
from pipeline.parts.builtin.door_shape import DoorShape
from pipeline.parts.builtin.length import bounded
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError

DEFAULT_FACET_UM = 40.0


@dataclass(frozen=True, kw_only=True, slots=True)
class CarDoor:
    """Sizes of the panel. x runs along the car (rear at +x), y up, z outward."""

    length_mm: float = bounded(880.0, 500.0, 1300.0, "mm", "size along x, about")
    height_mm: float = bounded(560.0, 450.0, 800.0, "mm", "size along y, about")
    sheet_mm: float = bounded(0.8, 0.5, 1.5, "mm", "thickness of the sheet")
    radius_x_mm: float = bounded(5200.0, 1500.0, 50000.0, "mm", "crown radius along the car")
    radius_y_mm: float = bounded(1700.0, 800.0, 50000.0, "mm", "crown radius upward")
    corner_radius_mm: float = bounded(45.0, 30.0, 100.0, "mm", "radius of the lower corners")
    window_corner_mm: float = bounded(22.0, 20.0, 60.0, "mm", "radius of the upper corners")
    line_height_mm: float = bounded(5.0, 0.0, 12.0, "mm", "height of the shoulder line")
    line_radius_mm: float = bounded(12.0, 5.0, 60.0, "mm", "radius of the shoulder line's crest")
    tuck_mm: float = bounded(9.0, 0.0, 20.0, "mm", "depth by which the foot steps in")
    recess_length_mm: float = bounded(190.0, 90.0, 260.0, "mm", "handle recess, along x")
    recess_width_mm: float = bounded(78.0, 50.0, 120.0, "mm", "handle recess, along y")
    recess_depth_mm: float = bounded(17.0, 8.0, 25.0, "mm", "handle recess, below the skin")
    recess_wall_deg: float = bounded(70.0, 62.0, 78.0, "deg", "slope of the recess's walls")
    recess_rim_radius_mm: float = bounded(4.0, 2.0, 5.5, "mm", "convex radius of the recess's rim")
    recess_floor_radius_mm: float = bounded(5.0, 2.0, 5.5, "mm", "concave radius at its floor")
    hem_radius_mm: float = bounded(1.5, 1.1, 4.0, "mm", "outer radius of the hem's fold")
    hem_return_mm: float = bounded(9.0, 3.0, 15.0, "mm", "width of the folded-back strip")
    window_radius_mm: float = bounded(4.0, 2.0, 8.0, "mm", "radius of the window edge")
    window_flange_mm: float = bounded(16.0, 5.0, 30.0, "mm", "length of the window flange")


PARAMETERS = CarDoor


def make(door: CarDoor, facet_um: float | None) -> Part:
    """Tessellate the panel with facets within `facet_um` of the true surface.

    Regions: ``outer`` (the visible skin), ``recess`` (its rim, walls and floor), ``wall``,
    ``line`` (crest of the shoulder line), ``hem``, ``window``, ``inner``.
    """
    _check(door)
    shape = DoorShape(door)
    facet_mm = (DEFAULT_FACET_UM if facet_um is None else facet_um) / 1000.0
    try:
        vertices, faces, side, middle = close_sheet(shape.sheet, facet_mm=0.8 * facet_mm)
    except TooFineError as error:
        raise PartError(
            "builtin:car_door", f"facet_um = {facet_um:g} {error}", "coarser facets"
        ) from error
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = vertices - [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2]]
    x, y, fold, window = shape.where(middle[:, 0], middle[:, 1])
    q = shape.recess.distance_mm(x, y)
    out, skin = side == 0, fold <= 0.0
    recess = out & skin & (q <= shape.recess.rim_mm)
    return Part(
        name="car_door",
        vertices_mm=vertices,
        faces=faces,
        regions={
            "outer": out & skin,
            "recess": recess,
            "wall": recess & shape.recess.on_wall(q),
            "line": out & skin & (np.abs(shape.line_distance_mm(x, y)) < door.line_radius_mm / 2),
            "hem": (side != 1) & ~skin & ~window,
            "window": (side != 1) & ~skin & window,
            "inner": side == 1,
        },
        source="builtin:car_door",
    )


def _check(door: CarDoor) -> None:
    """Refuse sizes that don't fit each other."""
    reach = DoorShape(door).recess.x_mm + door.recess_length_mm / 2.0
    problems = (
        (
            door.hem_radius_mm < door.sheet_mm + 0.2,
            f"hem_radius_mm = {door.hem_radius_mm:g} with a sheet of {door.sheet_mm:g} mm",
            "allowed: 0.2 mm above sheet_mm or more",
        ),
        (
            door.recess_length_mm < door.recess_width_mm,
            "recess_length_mm is less than recess_width_mm",
            "a longer or narrower recess",
        ),
        (
            reach > door.length_mm / 2.0 - 30.0,
            f"recess_length_mm = {door.recess_length_mm:g} reaches the panel's edge",
            "a shorter recess or a longer panel",
        ),
    )
    for wrong, what, mend in problems:
        if wrong:
            raise PartError("builtin:car_door", what, mend)
