"""How far the laws of a model hold at depth edges, by what the fitted readings say.

No law is exact there: where a line is cut or lies on a crease, the reading depends on optics and
on finders that a few numbers don't describe. What a model changes at edges therefore counts by the
share of it that readings bear out, learnt for small and large changes apart. What moves the sensor
isn't a law of that kind: it is cast.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.noise import Field
from diagnosis.workspace import Model, Workspace
from sensors.effects.base import Effect, MotionEffect

STEPS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Where classes of changes begin, in units of the noise."""
FARTHEST = 10.0
"""A reading that is farther off, in units of the noise, counts as this far."""
FRIENDS = 10
"""So many readings of each class are taken to have borne the law out before any is looked at."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Trust:
    """Share of a change at edges that is borne out, for each class of `STEPS`."""

    shares: Field

    def share(self, change: Field) -> Field:
        """Return the share for changes (any shape) in units of the noise."""
        size = np.abs(np.nan_to_num(change))
        return np.asarray(self.shares[np.searchsorted(STEPS, size, side="right") - 1])


def trust(ws: Workspace, model: Model) -> Trust:
    """Regress readings at edges on what the model changes there, class by class."""
    model = replace(model, effects=tuple(bending_effects(model.effects)))
    products, squares = np.zeros(len(STEPS)), np.zeros(len(STEPS))
    count = np.zeros(len(STEPS))
    if model.effects:
        moved = ws.placements(model)
        both = zip(ws.patches, ws.predict(Model()), ws.predict(model), ws.masks(), strict=True)
        for patch, plain, full, mask in both:
            sd = ws.noise.sd_mm
            change = (full.mean_mm - plain.mean_mm) / sd
            left = (patch.depth_mm - plain.mean_mm - patch.columns @ moved[patch.recording]) / sd
            pick = mask & patch.edge & np.isfinite(change) & np.isfinite(left)
            c, r = (np.clip(v[pick], -FARTHEST, FARTHEST) for v in (change, left))
            which = np.searchsorted(STEPS, np.abs(c), side="right") - 1
            products += np.bincount(which, c * r, len(STEPS))
            squares += np.bincount(which, c * c, len(STEPS))
            count += np.bincount(which, minlength=len(STEPS))
    before = FRIENDS * squares / np.maximum(count, 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = (products + before) / (squares + before)
    return Trust(shares=np.clip(np.nan_to_num(shares, nan=1.0), 0.0, 1.0))


def bending_effects(effects: Sequence[Effect]) -> list[Effect]:
    """Return the effects whose laws are trusted by halves: those that don't move the sensor."""
    return [e for e in effects if not isinstance(e, MotionEffect)]
