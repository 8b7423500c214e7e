"""Periodic error of the travel: profiles lie before or behind their stated position."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import MotionEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.effects.sinusoid import ProfileWave, phase
from sensors.view.rigid import rigid_jacobian
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class TravelRipple(ProfileWave, MotionEffect):
    """A sine of the travel displaces each profile along y; the phase is per recording."""

    name: ClassVar = "travel_ripple"
    summary: ClassVar = (
        "The travel has a periodic error: profiles are taken before or behind their stated "
        "position, which biases readings on slopes."
    )
    equation: ClassVar = "δy = A sin(2π s / period + φ); to first order δz = dz/dy · δy"
    source: ClassVar = "Periodic error of lead screw, belt or encoder, 5 to 100 µm"
    statement: ClassVar = (
        "The travel has a periodic error of {amplitude_um:.0f} µm with a period of {period_mm:.2f} "
        "mm, which biases readings on slopes and not on flats."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "travel"
    covariate: ClassVar = "travel"
    relaxed: ClassVar = (
        Relaxed(channel="mean", each="profile", periodic=True, period="period_mm", times="shift_y"),
    )
    rivals: ClassVar = ("stage_vibration", "form_error", "incidence_bias")
    separating: ClassVar = (
        "compare flats with slopes: a travel error biases slopes only; change the speed: a travel "
        "error keeps its period in mm"
    )

    amplitude_um: float = parameter(
        "amplitude A along the travel",
        unit="µm",
        low=0.0,
        high=5000.0,
        typical=30.0,
        null=0.0,
        linear=True,
    )
    period_mm: float = parameter(
        "period along the travel",
        unit="mm",
        low=0.01,
        high=5000.0,
        typical=5.0,
    )
    phase_rad: float | None = phase()

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return slope times sine and cosine of the travel: the first order."""
        turn = 2 * math.pi / self.period_mm * view.travel_mm[:, None]
        push = rigid_jacobian(view)[1]
        return 1e-3 * push * np.sin(turn), 1e-3 * push * np.cos(turn)

    def moved(self, view: View) -> View:
        """Return the view with each profile at its true position."""
        turn = 2 * math.pi / self.period_mm * view.travel_mm + (self.phase_rad or 0.0)
        return view.shifted(dy_mm=1e-3 * self.amplitude_um * np.sin(turn))
