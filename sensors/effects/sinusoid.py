"""Effects that are a sine: amplitude and phase, and trial frequencies of those over profiles."""

import math
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.view.view import View

Floats = NDArray[np.float64]

FEWEST = 4
"""Profiles below which no frequency is resolved."""


class SinusoidalEffect(Effect):
    """An effect A sin(ψ + φ): its fields are the sine and the cosine of ψ.

    The amplitude A is the one linear parameter, the phase φ is `phase_rad`.
    """

    __slots__ = ()

    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the coefficients of sine and cosine."""
        name = self._amplitude()
        return f"{name}_sin", f"{name}_cos"

    def coefficients(self) -> Floats:
        """Return A cos(φ) and A sin(φ); an unknown phase counts as 0."""
        amplitude = float(getattr(self, self._amplitude()))
        phase_rad = float(getattr(self, "phase_rad", None) or 0.0)
        return np.array([amplitude * math.cos(phase_rad), amplitude * math.sin(phase_rad)])

    def with_coefficients(self, coefficients: Floats) -> Self:
        """Return the effect with the amplitude and the phase of these coefficients.

        Raises
        ------
        RecipeError
            Where the amplitude would be out of its bounds.
        """
        cosine, sine = (float(c) for c in np.asarray(coefficients).ravel())
        phase_rad = math.atan2(sine, cosine) % (2 * math.pi)
        amplitude = math.hypot(cosine, sine)
        return self.with_parameters({self._amplitude(): amplitude, "phase_rad": phase_rad})

    @classmethod
    def _amplitude(cls) -> str:
        return next(p.name for p in cls.parameters() if p.linear)


class ProfileWave(SinusoidalEffect):
    """A sine over the profiles: of time by a frequency, or of the travel by a period.

    The relaxed form names the parameter that is the frequency or the period.
    """

    __slots__ = ()

    def grid(self, view: View) -> tuple[Self, ...]:
        """Return waves half a resolution element apart, down to two profiles a cycle."""
        form = next(r for r in self.relaxed if r.frequency or r.period)
        p = self.parameter(form.frequency or form.period)
        found = resolved_frequencies(view.time_s if form.frequency else view.travel_mm)
        if not found.size:
            return (self,)
        found = found if form.frequency else 1.0 / found
        found = found[(found >= p.low) & (found <= p.high)]
        return tuple(self.with_parameters({p.name: float(value)}) for value in found)


def phase() -> Any:
    """Declare the phase at the first profile, a per-recording parameter."""
    return parameter(
        "phase φ at the first profile",
        unit="rad",
        low=0.0,
        high=6.2831853072,
        typical=0.0,
        owner="recording",
    )


def resolved_frequencies(at: Floats) -> Floats:
    """Frequencies half a resolution element apart, up to half the sampling rate.

    Parameters
    ----------
    at : (n,) where the profiles lie, s or mm

    Returns
    -------
    (k,) cycles a unit of `at`; none for few profiles, or all at one place
    """
    span = float(np.ptp(at))
    if len(at) < FEWEST or span == 0.0:
        return np.empty(0)
    top = 0.5 / float(np.median(np.abs(np.diff(at))))
    return np.arange(0.5 / span, top, 0.5 / span)
