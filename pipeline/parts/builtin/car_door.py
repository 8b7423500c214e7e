"""The outer panel of a car door: stamped sheet with handle recess, feature lines and hem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.parts.builtin.adaptive_sheet import TooFineError, close_sheet
from pipeline.parts.builtin.door_shape import DoorShape
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from quantity import quantity

DEFAULT_FACET_UM = 40.0


@dataclass(frozen=True, kw_only=True, slots=True)
class CarDoor:
    """Sizes of the panel. x runs along the car (rear at +x), y up, z outward."""

    length_mm: float = quantity(
        "size along x, about", unit="mm", low=500.0, high=1300.0, default=880.0
    )
    height_mm: float = quantity(
        "size along y, about", unit="mm", low=450.0, high=800.0, default=560.0
    )
    sheet_mm: float = quantity("thickness of the sheet", unit="mm", low=0.5, high=1.5, default=0.8)
    radius_x_mm: float = quantity(
        "crown radius along the car", unit="mm", low=1500.0, high=50000.0, default=5200.0
    )
    radius_y_mm: float = quantity(
        "crown radius upward", unit="mm", low=800.0, high=50000.0, default=1700.0
    )
    corner_radius_mm: float = quantity(
        "radius of the lower corners", unit="mm", low=30.0, high=100.0, default=45.0
    )
    window_corner_mm: float = quantity(
        "radius of the upper corners", unit="mm", low=20.0, high=60.0, default=22.0
    )
    line_height_mm: float = quantity(
        "height of the shoulder line", unit="mm", low=0.0, high=12.0, default=5.0
    )
    line_radius_mm: float = quantity(
        "radius of the shoulder line's crest", unit="mm", low=5.0, high=60.0, default=12.0
    )
    tuck_mm: float = quantity(
        "depth by which the foot steps in", unit="mm", low=0.0, high=20.0, default=9.0
    )
    recess_length_mm: float = quantity(
        "handle recess, along x", unit="mm", low=90.0, high=260.0, default=190.0
    )
    recess_width_mm: float = quantity(
        "handle recess, along y", unit="mm", low=50.0, high=120.0, default=78.0
    )
    recess_depth_mm: float = quantity(
        "handle recess, below the skin", unit="mm", low=8.0, high=25.0, default=17.0
    )
    recess_wall_deg: float = quantity(
        "slope of the recess's walls", unit="°", low=62.0, high=78.0, default=70.0
    )
    recess_rim_radius_mm: float = quantity(
        "convex radius of the recess's rim", unit="mm", low=2.0, high=5.5, default=4.0
    )
    recess_floor_radius_mm: float = quantity(
        "concave radius at its floor", unit="mm", low=2.0, high=5.5, default=5.0
    )
    hem_radius_mm: float = quantity(
        "outer radius of the hem's fold", unit="mm", low=1.1, high=4.0, default=1.5
    )
    hem_return_mm: float = quantity(
        "width of the folded-back strip", unit="mm", low=3.0, high=15.0, default=9.0
    )
    window_radius_mm: float = quantity(
        "radius of the window edge", unit="mm", low=2.0, high=8.0, default=4.0
    )
    window_flange_mm: float = quantity(
        "length of the window flange", unit="mm", low=5.0, high=30.0, default=16.0
    )


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
