"""The relaxed form of an effect's law: what it follows, whatever its exact curve.

A cause is recognised by the covariate that it follows, not by its formula. An effect states here
which part of the law of a reading it changes, along what, and how that is modulated; a diagnosis
builds an arbitrary smooth (periodic, per-profile, ...) function of it and knows nothing else.
"""

from dataclasses import dataclass
from typing import Literal

RelaxedChannel = Literal["mean", "scale", "missing", "outliers"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Relaxed:
    """One component that an effect adds to the law of a reading.

    Attributes
    ----------
    channel : mean (depth, mm), scale (logarithm of the noise), missing or outliers (logit of the
        share of the readings)
    along : covariates of a smooth function; () for a constant
    even : whether the function is even in the first of them
    each : an independent value for each profile of each recording, or for each column
    times : covariate that the function is multiplied by; "" for 1
    periodic : whether the function repeats with every unit of its covariate
    spanned : whether the component is what the law itself does to the mean at the points of the
        effect's grid, for laws of light and edges that follow no single covariate
    frequency, period : parameter of the effect that holds the frequency, or the period, of what
        repeats
    grows : whether a constant can only grow: more losses than a good instrument's, never fewer
    """

    channel: RelaxedChannel
    along: tuple[str, ...] = ()
    even: bool = False
    each: Literal["", "profile", "column"] = ""
    times: str = ""
    periodic: bool = False
    spanned: bool = False
    grows: bool = False
    frequency: str = ""
    period: str = ""
