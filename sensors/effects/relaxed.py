"""The relaxed form of an effect's law: what it follows, whatever its exact curve.

A cause is recognised by the covariate that it follows, not by its formula. An effect states here
which part of the law of a reading it changes, along what, and how that is modulated; a diagnosis
builds an arbitrary smooth (periodic, per-profile, ...) function of it and knows nothing else.
"""

from dataclasses import dataclass
from typing import Literal

from sensors.view.covariates import COVARIATES

RelaxedChannel = Literal["mean", "scale", "missing", "outliers"]
MOMENTS = {"mean": "mean", "scale": "variance", "missing": "missing", "outliers": "tails"}
"""Channel of an effect (`Effect.channels`) by that of its relaxed forms."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Relaxed:
    """One component that an effect adds to the law of a reading.

    Attributes
    ----------
    channel : mean (depth, mm), scale (logarithm of the noise), missing or outliers (logit of the
        share of the readings); `MOMENTS` holds what the effect's `channels` call them
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

    Raises
    ------
    ValueError
        For a covariate that doesn't exist, or a form that no diagnosis can build.
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

    def __post_init__(self) -> None:
        for name in (*self.along, *([self.times] if self.times else [])):
            if name not in COVARIATES:
                raise ValueError(f"relaxed form: no covariate '{name}'; there are {[*COVARIATES]}")
        free = not (self.along or self.each or self.times or self.periodic)
        rows = self.along == ("camera_row",)
        for wrong, what in (
            (self.spanned and not free, "spanned excludes along, each, times and periodic"),
            (self.spanned and self.channel not in ("mean", "missing"),
             "spanned is for mean and missing"),
            (bool(self.each and self.along), "each excludes along"),
            (bool(self.times) and (self.channel != "mean" or self.each == "column"),
             "times is for the mean, along covariates or for each profile"),
            (self.periodic and not (self.channel == "mean" and (rows or self.each == "profile")),
             "periodic is for the mean, along camera_row or for each profile"),
            (self.periodic and not (self.frequency or self.period),
             "periodic needs the parameter that is its frequency or period"),
            (self.even and not self.along, "even needs along"),
            (self.grows and not free, "grows is for a constant"),
        ):  # fmt: skip
            if wrong:
                raise ValueError(f"relaxed form: {what}")
