"""Common to effects that are a sine along a recording: phase and trial frequencies."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensors.effects.parameter import parameter

Floats = NDArray[np.float64]

FEWEST = 4
"""Profiles below which no frequency is resolved."""


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
