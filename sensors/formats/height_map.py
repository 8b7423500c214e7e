"""A height map as an instrument delivered it: heights on the instrument's own grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensors.typed_yaml import RecipeError

Floats = NDArray[np.float64]

UNITS_MM = {"m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3, "µm": 1e-3, "nm": 1e-6, "in": 25.4}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class HeightMap:
    """Readings in mm, one row a profile, and what the file says about how they were taken.

    Attributes
    ----------
    readings_mm : (n_profiles, n_points) float64
        Heights above the instrument's zero (or depths, where the user says so), mm; NaN = missing.
    x_mm : (n_points,) float64 or None
        Where the columns are, mm.
    y_mm : (n_profiles,) float64 or None
        Where the rows are, mm.
    intensity : (n_profiles, n_points) float64 or None
        Brightness, 0 to 1.
    step_mm : float or None
        Resolution of the readings, mm.
    note : str
        What the file says of itself: instrument, frame number.
    unit_mm : float
        mm in one of the file's own numbers, where it is a bare table or image.
    """

    readings_mm: Floats
    x_mm: Floats | None = None
    y_mm: Floats | None = None
    intensity: Floats | None = None
    step_mm: float | None = None
    note: str = ""
    unit_mm: float = 1.0


def scale_mm(unit: str | None, held: str | None = None) -> float:
    """Return mm in a unit: the one that the user gave, else the file's own, else mm.

    Raises
    ------
    RecipeError
        Where the unit is unknown.
    """
    name = unit or held or "mm"
    name = {"μm": "µm", "micrometer": "um", "micron": "um", '"': "in", "inch": "in"}.get(name, name)
    if name not in UNITS_MM:
        raise RecipeError("unknown unit", value=name, allowed=", ".join(UNITS_MM))
    return UNITS_MM[name]
