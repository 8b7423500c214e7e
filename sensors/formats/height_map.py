"""A height map as an instrument delivered it: heights on the instrument's own grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats.units import LENGTHS_MM, UNITS_MM

Floats = NDArray[np.float64]

@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class HeightMap:
    """Readings in mm, one row per profile, and the file's facts about the measurement.

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
        What the file states about itself: instrument, frame number.
    unit_mm : float
        mm in one of the file's own numbers, where it is a bare table or image.
    slope_x : (n_points,) float64 or None
        Rays of an unrectified instrument: reading j lies at x_mm[j] + slope_x[j] * reading.
    time_s : (n_profiles,) float64 or None
        When each profile was taken, seconds.
    row_counts : bool
        Whether `y_mm` are counts of an encoder, whose length no one states.
    unit_stated : bool
        Whether the file itself states the unit of its heights.
    decisions : tuple of str
        What was recognised, taken or left out, in words for the user.
    """

    readings_mm: Floats
    x_mm: Floats | None = None
    y_mm: Floats | None = None
    intensity: Floats | None = None
    step_mm: float | None = None
    note: str = ""
    unit_mm: float = 1.0
    slope_x: Floats | None = None
    time_s: Floats | None = None
    row_counts: bool = False
    unit_stated: bool = False
    decisions: tuple[str, ...] = ()


def scale_mm(unit: str | None, held: str | None = None) -> float:
    """Return mm in a unit: the one that the user gave, else the file's own, else mm.

    Raises
    ------
    RecipeError
        Where the unit is unknown.
    """
    name = unit or held or "mm"
    if name.lower() not in LENGTHS_MM:
        raise RecipeError("unknown unit", value=name, allowed=", ".join(UNITS_MM))
    return LENGTHS_MM[name.lower()]


def unit_decision(unit: str | None, held: str | None) -> tuple[str, ...]:
    """Return the note on the heights' unit: contradicted or accepted."""
    if held is None:
        return ()
    if unit is not None and scale_mm(unit) != scale_mm(held):
        return (f"the file says that heights are in {held}; taken as {unit}, as given",)
    return (f"heights are in {held}, as the file says",) if unit is None else ()
