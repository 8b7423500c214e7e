"""Vibration of stage or sensor: whole profiles move."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import AdditiveEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.effects.sinusoid import ProfileWave, phase
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class StageVibration(ProfileWave, AdditiveEffect):
    """A sine of time, equal in all columns; the phase is a per-recording parameter."""

    name: ClassVar = "stage_vibration"
    summary: ClassVar = "Whole profiles move in depth at a constant frequency."
    equation: ClassVar = "A sin(2π f t + φ); aliased above half the profile rate"
    source: ClassVar = "Forced vibration of a stage, 2 to 50 µm, 5 to 250 Hz"
    statement: ClassVar = (
        "Stage or mounting vibrates: whole profiles move in depth with an amplitude of"
        " {amplitude_um:.1f} µm at {frequency_hz:.1f} Hz, or at an alias above half the profile"
        " rate."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "time"
    covariate: ClassVar = "time"
    relaxed: ClassVar = (
        Relaxed(channel="mean", each="profile", periodic=True, frequency="frequency_hz"),
    )
    rivals: ClassVar = ("travel_ripple", "form_error", "pixel_locking")
    separating: ClassVar = (
        "change the speed: a vibration keeps its frequency in Hz, waviness of the part its "
        "wavelength in mm"
    )

    amplitude_um: float = parameter(
        "amplitude A along the depth",
        unit="µm",
        low=0.0,
        high=1000.0,
        typical=10.0,
        null=0.0,
        linear=True,
    )
    frequency_hz: float = parameter(
        "frequency f",
        unit="Hz",
        low=0.01,
        high=5000.0,
        typical=25.0,
    )
    phase_rad: float | None = phase()

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return sine and cosine of time, equal in all columns."""
        turn = 2 * math.pi * self.frequency_hz * view.time_s[:, None]
        return 1e-3 * np.sin(turn), 1e-3 * np.cos(turn)
