"""Bias of readings that depends on the angle of incidence."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import AdditiveEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.view.view import View

Floats = NDArray[np.float64]

STEEPEST_DEG = 80.0
"""Incidence beyond which the bias is held constant."""


@dataclass(frozen=True, kw_only=True, slots=True)
class IncidenceBias(AdditiveEffect):
    """A bias in the signed slope along the travel and the squared tangent of the incidence."""

    name: ClassVar = "incidence_bias"
    summary: ClassVar = (
        "Readings are biased by an amount that depends on the angle of incidence and its sign."
    )
    equation: ClassVar = "b1 dz/dy + b2 tan² β"
    source: ClassVar = (
        "First orders of a bias over the signed slope; 10 to 50 µm at 45° measured by Van Gestel,"
        " Cuypers, Bleys, Kruth, Opt. Lasers Eng. 47 (2009) 336, and Feng, Liu, Xi, Precision "
        "Eng. 25 (2001) 185"
    )
    statement: ClassVar = (
        "Oblique surfaces are biased by {signed_um:.0f} µm at 45° along the travel, with the sign "
        "of the slope, and by {squared_um:.0f} µm at 45° of incidence on either side."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "slope_y"
    relaxed: ClassVar = (Relaxed(channel="mean", along=("slope_y",)),)
    rivals: ClassVar = ("pose_error", "volume_scattering", "form_error", "travel_ripple")
    separating: ClassVar = (
        "scan the same part in several poses: the bias follows the angle, not the part"
    )

    signed_um: float = parameter(
        "bias b1 at a slope of 45° along the travel",
        unit="µm",
        low=-500.0,
        high=500.0,
        typical=20.0,
        null=0.0,
        linear=True,
    )
    squared_um: float = parameter(
        "bias b2 at 45° of incidence",
        unit="µm",
        low=-500.0,
        high=500.0,
        typical=10.0,
        null=0.0,
        linear=True,
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return slope and squared tangent, held constant beyond the steepest angle."""
        steepest = math.tan(math.radians(STEEPEST_DEG))
        slope = np.clip(view.slope_y, -steepest, steepest)
        tangent = np.tan(np.minimum(view.incidence_rad, math.radians(STEEPEST_DEG)))
        return 1e-3 * slope, 1e-3 * np.square(tangent)
