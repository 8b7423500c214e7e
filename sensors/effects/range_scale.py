"""Scale error of the range."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import AdditiveEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class RangeScale(AdditiveEffect):
    """An error proportional to the distance from the working distance."""

    name: ClassVar = "range_scale"
    summary: ClassVar = "Heights have a constant relative error."
    equation: ClassVar = "e (z - WD)"
    source: ClassVar = "First order of a residual range calibration; 1e-4 to 1e-3"
    statement: ClassVar = (
        "Heights have a scale error of {error_ppm:.0f} parts per million of the distance from "
        "mid-range."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "depth"
    relaxed: ClassVar = (Relaxed(channel="mean", along=("depth",)),)
    rivals: ClassVar = ("thermal_drift", "lens_distortion")
    separating: ClassVar = "measure a certified step, cold and warm"

    error_ppm: float = parameter(
        "relative error e of the range",
        unit="ppm",
        low=-20000.0,
        high=20000.0,
        typical=500.0,
        null=0.0,
        linear=True,
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the distance from the working distance."""
        return (1e-6 * (view.depth_mm - view.datasheet.working_distance_mm),)
