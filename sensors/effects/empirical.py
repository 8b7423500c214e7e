"""A fitted curve over a covariate, for a residual that no physical effect explains."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law
from sensors.piecewise_linear import hats_at
from sensors.view.covariates import COVARIATES
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Empirical(Effect):
    """Values at knots of one covariate, linear between the knots, constant beyond."""

    name: ClassVar = "empirical"
    summary: ClassVar = "A fitted curve over one covariate, without a physical model."
    equation: ClassVar = (
        "mean + f(c), standard deviation · exp(f(c)), or p_missing = f(c); f by knots"
    )
    source: ClassVar = "none: the curve marks an unexplained residual"
    statement: ClassVar = (
        "The {channel} depends on {against}, by up to {values:.3g}{unit}, and no effect of the "
        "catalogue explains the dependence: the curve is fitted."
    )
    channels: ClassVar = ("mean", "variance", "missing")
    frame: ClassVar = "sensor"
    covariate: ClassVar = "depth"
    rivals: ClassVar = ()
    separating: ClassVar = "vary this covariate alone and compare the curve"

    against: str = parameter(
        "covariate over which the curve runs", choices=tuple(COVARIATES), typical="depth"
    )
    channel: str = parameter(
        "quantity that changes: mean (µm added), variance (log factor on the standard deviation), "
        "or missing (probability)",
        choices=("mean", "variance", "missing"),
        typical="mean",
    )
    knots: tuple[float, ...] = parameter(
        "rising values of the covariate, in its unit; one for each value",
        low=-1e9,
        high=1e9,
        typical=(0.0, 1000.0),
        kind="list",
    )
    values: tuple[float, ...] = parameter(
        "values of the curve at the knots: µm, logarithm of a factor, or probability",
        low=-1e5,
        high=1e5,
        typical=(0.0, 50.0),
        null=0.0,
        linear=True,
        kind="list",
    )

    def __post_init__(self) -> None:
        Effect.__post_init__(self)
        rising = np.all(np.diff(self.knots) > 0)
        if self.values and (len(self.knots) != len(self.values) or not rising):
            raise RecipeError(
                "knots of effect empirical",
                value=self.knots,
                allowed="rising numbers, as many as values",
            )
        if self.channel == "missing" and not all(0.0 <= v <= 1.0 for v in self.values):
            raise RecipeError(
                "values of effect empirical", value=self.values, allowed="probabilities, 0 to 1"
            )

    def words(self) -> dict[str, str]:
        """Return the covariate's description and the unit for the statement."""
        unit = {"mean": " µm", "variance": " (logarithm)", "missing": ""}[self.channel]
        return {"against": COVARIATES[self.against].words, "unit": unit}

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return a hat function of the covariate for each knot, where the mean changes."""
        if self.channel != "mean" or not self.values:
            return ()
        return tuple(1e-3 * self._hats(view))

    def changed(self, law: Law, view: View) -> Law:
        """Change the curve's channel; zero change where the covariate is unknown."""
        curve = np.tensordot(np.array(self.values), self._hats(view), axes=1)
        if self.channel == "mean":
            return law.biased(1e-3 * curve)
        return law.noisier(np.exp(curve)) if self.channel == "variance" else law.losing(curve)

    def _hats(self, view: View) -> Floats:
        covariate = COVARIATES[self.against].values(view)
        known = np.isfinite(covariate)
        hats = hats_at(np.where(known, covariate, 0.0), np.array(self.knots))
        return np.where(known, hats, 0.0)
