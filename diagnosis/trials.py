"""Trials: one more effect beside a model, fitted, and judged on readings it took no part in."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from diagnosis.fit import fit_effect
from diagnosis.heldout import own_parts, settle_own
from diagnosis.linear import Fitted, is_linear, phase_is_own
from diagnosis.noise import Field, Mask
from diagnosis.prediction import Prediction
from diagnosis.score import Whitened
from diagnosis.workspace import Model, Workspace
from sensors.effects import CATALOGUE
from sensors.effects.base import Effect, MotionEffect


@dataclass(frozen=True, kw_only=True, eq=False)
class Trials:
    """Fits of one more effect beside a model, made when first asked for.

    Attributes
    ----------
    ws : the readings that are searched
    """

    ws: Workspace
    model: Model
    _fitted: dict[tuple[str, bool], Fitted | None] = field(default_factory=dict)
    _judged: dict[str, tuple[Model, Field]] = field(default_factory=dict)

    @cached_property
    def _before(self) -> tuple[list[Prediction], list[Whitened]]:
        predictions = self.ws.predict(self.model)
        return predictions, self.ws.states(predictions)

    @cached_property
    def _base(self) -> list[Field]:
        return self.ws.log_densities(self.model)

    def fitted(self, name: str, *, polish: bool) -> Fitted | None:
        """Fit an effect, see `fit_effect`."""
        key = name, polish
        if key not in self._fitted:
            self._fitted[key] = fit_effect(
                CATALOGUE[name], self.ws, self.model, *self._before, polish=polish
            )
        return self._fitted[key]

    def judged(self, name: str, fitted: Fitted) -> tuple[Model, Field]:
        """Return the model with a fitted effect, and its cross-fitted gain of each block."""
        if name not in self._judged:
            trial = self.ws.levelled(self.model.with_effect(fitted.effect, fitted.own))
            blocks = crossfitted(self.ws, self.model, CATALOGUE[name], fitted, self._base)
            self._judged[name] = trial, blocks
        return self._judged[name]


def crossfitted(
    ws: Workspace, model: Model, kind: type[Effect], fitted: Fitted, base: Sequence[Field]
) -> Field:
    """Gain of each block under numbers that it took no part in fitting.

    A wave's phase in a recording is settled on a fifth of its profiles and judged on the others;
    linear coefficients are solved on one half of the readings and judged on the other. A few
    searched numbers cost a nat each instead.
    """
    masks = ws.masks_for(fitted.effect)
    trial = ws.levelled(model.with_effect(fitted.effect, fitted.own))
    if phase_is_own(fitted.effect):
        small, rest = own_parts(masks)
        trial = settle_own(ws, trial, small, only=fitted.effect.name)
        blocks = _gain(ws, trial, base, rest)
        if issubclass(kind, MotionEffect):
            # edges move as well and may tell it from a blur; solved to first order, it may be
            # too far off there for them to speak against it
            whole = _gain(ws, trial, base, own_parts(ws.masks())[1])
            blocks = max(blocks, whole, key=np.sum)
        return blocks
    if not is_linear(fitted.effect, ws):
        blocks = _gain(ws, trial, base, masks)
        return blocks - fitted.free / blocks.size
    # a recording elsewhere on the part says nothing of the form here
    halves = fold_masks(ws, whole=kind.frame != "time" and kind.name != "form_error")
    states = ws.states(ws.predict(model))
    total: Field | float = 0.0
    for fit_on, judge in (halves, halves[::-1]):
        part = fit_effect(
            kind, ws, model, (), states, masks=_both(masks, fit_on), start=fitted.effect,
            polish=False,
        )  # fmt: skip
        if part is None:
            return np.zeros(ws.block_scores(base).size)
        trial = ws.levelled(model.with_effect(part.effect, part.own))
        total = total + _gain(ws, trial, base, _both(masks, judge))
    return np.asarray(total)


def _gain(
    ws: Workspace, trial: Model, base: Sequence[Field], masks: Sequence[Mask]
) -> Field:
    after = ws.log_densities(trial)
    return ws.block_scores([a - b for a, b in zip(after, base, strict=True)], masks)


def _both(one: Sequence[Mask], two: Sequence[Mask]) -> list[Mask]:
    return [a & b for a, b in zip(one, two, strict=True)]


def fold_masks(ws: Workspace, *, whole: bool = True) -> tuple[list[Mask], list[Mask]]:
    """Two halves of the readings: whole recordings where there are several, else big tiles.

    Parameters
    ----------
    whole : False divides every recording: what fades with time shows in some of them alone
    """
    recordings = sorted({p.recording for p in ws.patches})
    one, two = [], []
    for patch, mask in zip(ws.patches, ws.masks(), strict=True):
        if whole and len(recordings) > 1:
            side = np.full(patch.shape, recordings.index(patch.recording) % 2 == 0)
        else:
            n, m = patch.shape
            rows = (np.arange(n) * 4 // n)[:, None] + np.zeros((1, m), dtype=int)
            columns = np.zeros((n, 1), dtype=int) + (np.arange(m) * 4 // m)[None]
            side = (rows + columns) % 2 == 0
        one.append(mask & side)
        two.append(mask & ~side)
    return one, two
