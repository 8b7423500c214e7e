"""The expectation of a reading under a model: one function for fits, judge and maps.

No law is exact: at a depth edge, in a corner, a reading depends on optics and on peak finders that
a few numbers don't describe. What a model changes counts by a share learnt from fitted readings, of
small changes and large, off edges and at them (model/shrinkage.py). What moves the sensor is cast,
and counts whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagnosis.fields import Field, Mask
from diagnosis.predict.prediction import Prediction, law_of, predict
from diagnosis.settings import SETTINGS
from sensors.effects.base import Effect, MotionEffect
from sensors.view.view import View

if TYPE_CHECKING:
    from diagnosis.noise.noise_model import NoiseModel


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Shares:
    """Share of a change that fitted readings support, for each class of sizes."""

    off_edges: Field
    at_edges: Field

    def of(self, change: Field, edge: Mask) -> Field:
        """Return the share for changes (any shape) in units of the noise."""
        which = size_class(np.abs(np.nan_to_num(change)))
        return np.where(edge, self.at_edges[which], self.off_edges[which])

    @property
    def key(self) -> bytes:
        """What equal shares have in common."""
        return self.off_edges.tobytes() + self.at_edges.tobytes()


def size_class(size: Field) -> NDArray[np.intp]:
    """Class of changes by their sizes (any shape), in units of the noise."""
    return np.searchsorted(SETTINGS.predict.size_classes, size, side="right") - 1


def bending_effects(effects: Sequence[Effect]) -> list[Effect]:
    """Return the effects that change what is read, not where the sensor is."""
    return [e for e in effects if not isinstance(e, MotionEffect)]


def expect(
    view: View,
    effects: Sequence[Effect],
    noise: "NoiseModel",
    edge: Mask,
    *,
    softness: tuple[Field, Field] | None = None,
    level: float = 1.0,
    shares: Shares | None = None,
) -> Prediction:
    """Predict readings, what effects change by the share that readings support.

    Parameters
    ----------
    edge : (n, m) within reach of a depth edge
    softness, level : see `predict`
    shares : None counts every change whole
    """
    law = predict(view, effects, noise, softness=softness, level=level)
    bending = bending_effects(effects)
    if shares is None or not bending:
        return law
    change = law_of(view, bending, noise).mean_mm - law_of(view, (), noise).mean_mm
    change = np.nan_to_num(change)
    kept = shares.of(change / noise.sd_mm, edge)
    return replace(law, mean_mm=law.mean_mm - (1.0 - kept) * change)
