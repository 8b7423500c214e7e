"""A robot's path and the warmth of the instrument: where the sensor truly is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Robot:
    """Errors of the path beside the commanded one, each a smooth wave along the travel.

    Attributes
    ----------
    wander_mm, wander_rad
        Amplitude of the slow waves of each of six degrees of freedom.
    wander_period_mm
        Their length.
    ripple_mm, ripple_period_mm
        Of the belt's roller, along the travel.
    shake_mm, shake_hz
        Of the frame, along the depth.
    lost_mm, lost_at
        Travel lost by lost encoder pulses, and after which share of the scan.
    slip_mm, slip_every_mm
        Of a belt that sticks and slips: how far it lags before it gives, and the mean way between.
    eccentric_mm, roller_mm
        Of a roller off its centre, and its radius: the travel swings and the part is lifted with
        the roller's turn.
    """

    wander_mm: float = 0.0
    wander_rad: float = 0.0
    wander_period_mm: float = 30.0
    ripple_mm: float = 0.0
    ripple_period_mm: float = 3.0
    shake_mm: float = 0.0
    shake_hz: float = 20.0
    lost_mm: float = 0.0
    lost_at: float = 0.5
    slip_mm: float = 0.0
    slip_every_mm: float = 2.0
    eccentric_mm: float = 0.0
    roller_mm: float = 1.0

    def errors(
        self, travel_mm: Floats, time_s: Floats, way: Floats, rng: np.random.Generator
    ) -> tuple[Floats, Floats]:
        """Shifts (n, 3) in mm and turns (n, 3) in rad at each profile, sensor frame.

        Parameters
        ----------
        way : (3,) direction of the travel in the sensor's frame
        """
        phase = rng.uniform(0, 2 * np.pi, 9)
        slow = np.sin(2 * np.pi * travel_mm[:, None] / self.wander_period_mm + phase[:6])
        shift, turn = self.wander_mm * slow[:, :3], self.wander_rad * slow[:, 3:]
        roller = travel_mm / self.roller_mm + phase[8]
        ahead = self.ripple_mm * np.sin(2 * np.pi * travel_mm / self.ripple_period_mm + phase[6])
        ahead = ahead + self.lost_mm * (travel_mm > self.lost_at * travel_mm.max())
        ahead = ahead + self.eccentric_mm * np.sin(roller)
        if self.slip_mm > 0:
            ahead = ahead - self.slip_mm * self._stuck(travel_mm, rng)
        shift = shift + ahead[:, None] * way
        shift[:, 2] += self.shake_mm * np.sin(2 * np.pi * self.shake_hz * time_s + phase[7])
        shift[:, 2] += self.eccentric_mm * np.cos(roller)
        return shift, turn

    def _stuck(self, travel_mm: Floats, rng: np.random.Generator) -> Floats:
        """Share 0 to 1 of the way to the next slip: a saw whose teeth differ in length."""
        span = float(travel_mm.max()) + 1e-9
        count = int(4 * span / self.slip_every_mm) + 8
        teeth = self.slip_every_mm * rng.gamma(4.0, 0.25, count)
        ends = np.cumsum(teeth) - rng.uniform(0, teeth[0])
        tooth = np.searchsorted(ends, travel_mm)
        return np.asarray(1 - (ends[tooth] - travel_mm) / teeth[tooth])


@dataclass(frozen=True, kw_only=True, slots=True)
class Warmth:
    """Warming up: the camera's angle and its distance to the sheet creep.

    Attributes
    ----------
    turn_rad, shift_mm : in the end
    constant_s : time constant
    """

    turn_rad: float = 0.0
    shift_mm: float = 0.0
    constant_s: float = 120.0

    def at(self, clock_s: Floats) -> tuple[Floats, Floats]:
        """Turn of the camera (rad) and shift of its rows (mm on the part) at times."""
        grown = -np.expm1(-clock_s / self.constant_s)
        return self.turn_rad * grown, self.shift_mm * grown
