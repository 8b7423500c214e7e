"""Speckle noise grows with the angle of incidence."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.view import View

Floats = NDArray[np.float64]

STEEPEST_DEG = 80.0
"""Incidence beyond which the standard deviation is held constant."""


@dataclass(frozen=True, kw_only=True, slots=True)
class IncidenceNoise(Effect):
    """Factor on the speckle as a function of incidence and signed slope."""

    name: ClassVar = "incidence_noise"
    summary: ClassVar = (
        "The noise grows with the angle of incidence, or on surfaces inclined away from the camera."
    )
    equation: ClassVar = "σ² = σe² + σs² cos(β)^(-2n) exp(2 k dz/dy)"
    source: ClassVar = (
        "Speckle limit σz = C λ / (2π sin u sin θ): Dorsch, Häusler, Herrmann, Appl. Opt. 33 "
        "(1994) 1306; growth with incidence measured by Feng, Liu, Xi, Precision Eng. 25 (2001) "
        "185"
    )
    statement: ClassVar = (
        "The noise grows with the angle of incidence β, as cos β to the power -{exponent:.2f}."
    )
    channels: ClassVar = ("variance",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "incidence"
    relaxed: ClassVar = (
        Relaxed(channel="scale", along=("incidence",)),
        Relaxed(channel="scale", along=("slope_y",)),
    )
    rivals: ClassVar = ("roughness_level",)
    separating: ClassVar = "scan a flat plate of this material at several tilts"

    exponent: float = parameter(
        "power n of 1/cos β in the standard deviation",
        low=0.0,
        high=4.0,
        typical=1.0,
        null=0.0,
        grid=(0.5, 1.0, 2.0),
    )
    lean: float = parameter(
        "growth k of the logarithm of the standard deviation with dz/dy",
        low=-3.0,
        high=3.0,
        typical=0.0,
        null=0.0,
    )

    def changed(self, law: Law, view: View) -> Law:
        """Multiply the speckle's gain."""
        gain = self.gain(view.cos_incidence, view.slope_y)
        gain = np.where(view.in_range, gain, 1.0)
        return replace(law, speckle_gain=np.asarray(law.speckle_gain * gain))

    def gain(self, cos_incidence: Floats | float, slope_y: Floats | float) -> Floats:
        """Factor on the speckle of a surface at an incidence, with a slope dz/dy."""
        cosine = np.maximum(cos_incidence, math.cos(math.radians(STEEPEST_DEG)))
        slope = np.clip(slope_y, -1.0, 1.0)
        return np.asarray(cosine**-self.exponent * np.exp(self.lean * slope))
