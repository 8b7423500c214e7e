"""Forms of an effect that fix how the law changes: fields that add, and a sensor that moves."""

from abc import abstractmethod
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.law import Law
from sensors.view.view import View

__all__ = ["AdditiveEffect", "Effect", "MotionEffect"]

Floats = NDArray[np.float64]


class AdditiveEffect(Effect):
    """An effect whose mean is a linear combination of fields.

    The coefficients are the effect's linear parameters, in their order.
    """

    __slots__ = ()

    @abstractmethod
    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return a field for each coefficient, mm per unit, broadcastable to (n, m)."""

    def changed(self, law: Law, view: View) -> Law:
        """Add the fields, each times its coefficient, to the mean."""
        mean = np.array(np.broadcast_to(law.mean_mm, view.shape))
        for coefficient, field in zip(self.coefficients(), self.fields(view), strict=True):
            if coefficient != 0.0:
                mean += coefficient * field
        return replace(law, mean_mm=mean)


class MotionEffect(Effect):
    """An effect that changes the sensor's pose or rays, and with them the geometry."""

    __slots__ = ()

    @abstractmethod
    def moved(self, view: View) -> View:
        """Return the view from the sensor's true pose."""

    def changed(self, law: Law, view: View) -> Law:
        """Replace the geometry's mean by that of the true poses; keep the bias by other effects."""
        true = self.moved(view)
        mean = law.mean_mm + (true.depth_mm - view.depth_mm)
        reason = np.where(law.reason == 0, true.reason, law.reason)
        found = true.in_range & ~view.in_range
        mean = np.where(found, true.depth_mm, mean)
        reason = np.where(found, true.reason, reason).astype(np.uint8)
        return replace(law, mean_mm=mean, reason=reason)
