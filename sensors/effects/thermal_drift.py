"""Warm-up drift: the depth approaches a final offset."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import AdditiveEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.view.rigid import rigid_jacobian
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class ThermalDrift(AdditiveEffect):
    """An exponential approach over the time since the instrument's start.

    A camera that warms shifts all readings equally. A mount that warms moves the sensor along its
    axis; the two differ by about one hundredth, where an inclined ray meets a slope.
    """

    name: ClassVar = "thermal_drift"
    summary: ClassVar = "Readings drift while the instrument warms up."
    equation: ClassVar = (
        "D (1 - exp(-(t0 + t)/τ)), as a displacement times (n·z) / (n·d): n the surface's normal, "
        "z the sensor's axis, d the ray per mm of depth"
    )
    source: ClassVar = "First-order warming, 5 to 100 µm over minutes"
    statement: ClassVar = (
        "The depth drifts towards {amplitude_um:.0f} µm with a time constant of "
        "{time_constant_s:.4g} s as the instrument warms up."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "time"
    covariate: ClassVar = "clock"
    relaxed: ClassVar = (Relaxed(channel="mean", along=("clock",)),)
    rivals: ClassVar = ("range_scale", "pose_error", "stage_vibration")
    separating: ClassVar = (
        "repeat the scan after some minutes, with a clock common to all recordings"
    )

    amplitude_um: float = parameter(
        "final offset D",
        unit="µm",
        low=-1000.0,
        high=1000.0,
        typical=40.0,
        null=0.0,
        linear=True,
    )
    time_constant_s: float = parameter(
        "time constant τ",
        unit="s",
        low=0.1,
        high=36000.0,
        typical=600.0,
        grid=(1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 600.0, 1800.0),
    )
    elapsed_s: float | None = parameter(
        "time t0 from the instrument's start to the first profile",
        unit="s",
        low=0.0,
        high=360000.0,
        typical=0.0,
        owner="recording",
        known="start_time_s",
        prior=(0.0, 1800.0),
    )

    shifts: str = parameter(
        "what drifts: the readings alone, or the sensor itself",
        typical="reading",
        choices=("reading", "sensor"),
    )

    def variants(self, view: View) -> tuple[Self, ...]:
        """Return the drift of the mount."""
        return (self.with_parameters(shifts="sensor"),)

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the approach to one, for each reading."""
        start = view.start_time_s if view.start_time_s is not None else self.elapsed_s
        age = np.maximum((start or 0.0) + view.time_s[:, None], 0.0)
        grown = -1e-3 * np.expm1(-age / self.time_constant_s)
        return (grown if self.shifts == "reading" else -grown * rigid_jacobian(view)[2],)
