"""Trials: one more effect beside a model, fitted, and judged on readings it took no part in."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from diagnosis.curvature import numbers_of, quadratics
from diagnosis.edges import on_edges
from diagnosis.fit import fit_effect
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
    """Gain of each block under numbers that were fitted to the other half of the readings.

    What is linear is solved on each half. Numbers that are searched move from the common fit to
    the half's own maximum by a Newton step, a recording's own phase with them; on depth edges,
    where there is no such step, they are searched again. Which point of a coarse grid the search
    began at was chosen by all readings.
    """
    masks = ws.masks_for(fitted.effect)
    if is_linear(fitted.effect, ws) and not phase_is_own(fitted.effect):
        # a recording elsewhere on the part says nothing of the form here
        whole = kind.frame != "time" and kind.name != "form_error"
        halves = fold_masks(ws, whole=whole)
        models = [_solved_on(ws, model, kind, fitted, _both(masks, half)) for half in halves]
    else:
        halves = fold_masks(ws, whole=False)
        parts = [_both(masks, half) for half in halves]
        fit = _searched_on if on_edges(fitted.effect) else _stepped_on
        models = [fit(ws, model, kind, fitted, part) for part in parts]
    blocks = _judged_on_others(ws, models, base, [_both(masks, half) for half in halves])
    if issubclass(kind, MotionEffect):
        # edges move as well and may tell it from a blur; solved to first order, it may be too
        # far off there for them to speak against it
        whole_halves = [_both(ws.masks(), half) for half in halves]
        blocks = max(blocks, _judged_on_others(ws, models, base, whole_halves), key=np.sum)
    return blocks


def _judged_on_others(
    ws: Workspace,
    models: Sequence[Model | None],
    base: Sequence[Field],
    halves: Sequence[Sequence[Mask]],
) -> Field:
    """Gain of the blocks of each half under the model of the other; none where one failed."""
    total = np.zeros(ws.block_scores(base).size)
    if any(m is None for m in models):
        return total
    for trial, judged in zip(models, reversed(halves), strict=True):
        assert trial is not None
        total = total + _gain(ws, ws.levelled(trial), base, judged)
    return total


def _solved_on(
    ws: Workspace, model: Model, kind: type[Effect], fitted: Fitted, masks: Sequence[Mask]
) -> Model | None:
    """Solve linear coefficients on a part of the readings."""
    states = ws.states(ws.predict(model))
    part = fit_effect(
        kind, ws, model, (), states, masks=masks, start=fitted.effect, polish=False
    )
    return None if part is None else model.with_effect(part.effect, part.own)


def _searched_on(
    ws: Workspace, model: Model, kind: type[Effect], fitted: Fitted, masks: Sequence[Mask]
) -> Model | None:
    """Search on a part of the readings, from the common fit on."""
    states = ws.states(ws.predict(model))
    part = fit_effect(
        kind, ws, model, (), states, masks=masks, start=fitted.effect, polish=True
    )
    return None if part is None else model.with_effect(part.effect, part.own)


def _stepped_on(
    ws: Workspace, model: Model, kind: type[Effect], fitted: Fitted, part: Sequence[Mask]
) -> Model | None:
    """Move to the maximum of a part; numbers that it doesn't determine stay."""
    start: Model | None = model.with_effect(fitted.effect, fitted.own)
    if phase_is_own(fitted.effect):
        start = _solved_on(ws, model, kind, fitted, part)
    if start is None:
        return None
    start = ws.levelled(start)
    (about,) = quadratics(ws, start, numbers_of(start, of=fitted.effect.name), [part])
    return start if about is None else about.climbed(ws, start, part)


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
