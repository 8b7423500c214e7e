"""What a law leaves of its own cause: the free curve of the cause's component, kept beside the law.

A cause is recognised by what it follows; its formula may be another. Where the residual still
follows the covariate of a cause that was found, the component's most probable curve joins the
model, so that the remainder passes neither for another cause nor for noise.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.component import Component, curve_columns
from diagnosis.components.whitened_columns import column_groups
from sensors.effects.effect import Effect
from sensors.effects.parameter import Parameter
from sensors.law import Law
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Part:
    """The curve of one component.

    Attributes
    ----------
    component : whose
    ranges : (name, low, high) of the covariates over which its columns are drawn
    coefficients : of its columns, mm
    """

    component: Component
    ranges: tuple[tuple[str, float, float], ...]
    coefficients: tuple[float, ...]

    def field(self, view: View) -> Floats:
        """Change of the mean, mm, broadcastable to (n, m)."""
        if self.component.relaxed.each == "column":
            return np.asarray(self.coefficients)[column_groups(view.shape[1])][None]
        ranges = {name: (low, high) for name, low, high in self.ranges}
        made = curve_columns(self.component, view, ranges)
        assert made is not None
        return np.nan_to_num(sum(c * x for c, x in zip(self.coefficients, made, strict=True)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Curve(Effect):
    """Free curves beside laws; of a diagnosis alone, in no sensor's file."""

    name: ClassVar = "curve"
    channels: ClassVar = ("mean",)
    covariate: ClassVar = ""

    parts: tuple[Part, ...] = ()

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """None: it is no law."""
        return ()

    @property
    def is_null(self) -> bool:
        """Whether there is no curve."""
        return not self.parts

    def shift(self, view: View) -> Floats:
        """Return the sum of the curves (n, m), mm."""
        total = np.zeros(view.shape)
        for part in self.parts:
            total += part.field(view)
        return total

    def changed(self, law: Law, view: View) -> Law:
        """Add the curves to the mean."""
        return law.biased(self.shift(view))

    def beside(self, parts: Iterable[Part]) -> Self:
        """Add curves."""
        return type(self)(parts=(*self.parts, *parts))

    def only(self, name: str) -> Self:
        """Keep the curves of an effect."""
        return type(self)(parts=tuple(p for p in self.parts if p.component.effect == name))

    def without(self, *names: str) -> Self:
        """Leave out the curves of effects."""
        return type(self)(parts=tuple(p for p in self.parts if p.component.effect not in names))
