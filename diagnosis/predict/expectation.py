"""The expectation of a reading under a model: one function for fits, judge and maps.

No law is exact at depth edges: where a line is cut or lies on a crease, a reading depends on
optics and on peak finders that a few numbers don't describe. What a model changes there counts by
a share learnt from fitted readings (edge_shrinkage.py). What moves the sensor is cast, and counts
whole.
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
class EdgeShares:
    """Share of a change at edges that fitted readings support, for each class of sizes."""

    shares: Field

    def of(self, change: Field) -> Field:
        """Return the share for changes (any shape) in units of the noise."""
        size = np.abs(np.nan_to_num(change))
        return np.asarray(self.shares[edge_class(size)])


def edge_class(size: Field) -> NDArray[np.intp]:
    """Class of changes at edges by their sizes (any shape), in units of the noise."""
    return np.searchsorted(SETTINGS.predict.edge_classes, size, side="right") - 1


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
    shares: EdgeShares | None = None,
) -> Prediction:
    """Predict readings, what effects change at edges by the share that readings support.

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
    at_edges = np.where(edge, np.nan_to_num(change), 0.0)
    kept = shares.of(at_edges / noise.sd_mm)
    return replace(law, mean_mm=law.mean_mm - (1.0 - kept) * at_edges)
