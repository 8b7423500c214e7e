"""The camera's image of the laser plane: depth against fractional row, for a pinhole."""

import math

import numpy as np
from numpy.typing import NDArray

from sensors.datasheet import Datasheet

Floats = NDArray[np.float64]


def row_of_depth(depth_mm: Floats, datasheet: Datasheet, rows: float) -> Floats:
    """Fractional camera row on which a depth is imaged, 0 to `rows` over the working range.

    A pinhole at distance b beside the emitter is aimed at the working distance; its image plane is
    normal to that axis. A point (x, 0, z) appears at t(z) = tan(θ(z) - θ0) above the axis, with
    tan θ(z) = b / z, whatever its x:  t = (b/z - b/WD) / (1 + b²/(z WD)).

    Raises
    ------
    RecipeError
        Where the datasheet does not state the triangulation angle.
    """
    first, last = (_height(d, datasheet) for d in (datasheet.depth_min_mm, datasheet.depth_max_mm))
    return np.asarray(rows * (_height(depth_mm, datasheet) - first) / (last - first))


def depth_per_row(depth_mm: Floats, datasheet: Datasheet, rows: float) -> Floats:
    """Depth that one camera row spans at a depth, mm (dz/dv of `row_of_depth`)."""
    first, last = (_height(d, datasheet) for d in (datasheet.depth_min_mm, datasheet.depth_max_mm))
    base = _base(datasheet)
    wd = datasheet.working_distance_mm
    # t = b (wd - z) / (z wd + b²):  dt/dz = -b (wd² + b²) / (z wd + b²)²
    slope = -base * (wd**2 + base**2) / (depth_mm * wd + base**2) ** 2
    return np.asarray((last - first) / rows / slope)


def _base(datasheet: Datasheet) -> float:
    angle = math.radians(datasheet.require("triangulation_angle_deg"))
    return datasheet.working_distance_mm * math.tan(angle)


def _height(depth_mm: Floats | float, datasheet: Datasheet) -> Floats | float:
    base, wd = _base(datasheet), datasheet.working_distance_mm
    return base * (wd - depth_mm) / (depth_mm * wd + base**2)
