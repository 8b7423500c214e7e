"""95 % intervals of parameters: the sandwich of an M-estimator, one way for all that is fitted.

θ is estimated by the maximum of the log density Σ_b l_b of blocks of readings that count as
independent, each recording's placement and the noise's level profiled out. Then

    cov θ = A⁻¹ B A⁻¹,   A = -∂²Σl_b/∂θ²,   B = n/(n - p) Σ_b s_b s_b',   s_b = ∂l_b/∂θ

(Huber, Proc. 5th Berkeley Symp. (1967) 221; White, Econometrica 50 (1982) 1), whatever the noise
is, and an interval reaches t(0.975, n - p) deviations to each side. A phase of a recording is a
parameter like any other: a frequency is known the less for it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from diagnosis.noise import Field
from diagnosis.workspace import Model, Workspace
from sensors.effects.base import Effect
from sensors.typed_yaml import RecipeError

LEVEL = 0.95
FIRST_STEP = 0.03
"""First step of the numeric derivatives, of the value; the second comes from the curvature."""
FARTHER = 30.0
"""Factor by which the second step may differ from the first, to either side."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """A parameter's value and its 95 % interval, where one was computed."""

    value: float
    low: float | None = None
    high: float | None = None

    def as_json(self) -> dict[str, float]:
        """Return the entry of diagnosis.json; without an interval it has no `low` and `high`."""
        ends = {"low": self.low, "high": self.high}
        return {"value": self.value, **{k: v for k, v in ends.items() if v is not None}}


@dataclass(frozen=True, kw_only=True, slots=True)
class _Slot:
    """One fitted number: an effect's, or (recording) that recording's own of it."""

    effect: str
    name: str
    recording: int | None = None

    def kind(self, model: Model) -> Effect:
        return next(e for e in model.effects if e.name == self.effect)

    def value(self, model: Model) -> float:
        if self.recording is not None:
            return float(model.own[self.recording][self.effect][self.name])
        return float(getattr(self.kind(model), self.name))

    def step(self, model: Model) -> float:
        """Return a first step, a small part of the value or of a typical one."""
        p = self.kind(model).parameter(self.name)
        typical = p.typical if isinstance(p.typical, int | float) else 1.0
        return max(FIRST_STEP * max(abs(self.value(model)), 0.1 * abs(typical)), 1e-9)

    def moved(self, model: Model, by: float) -> Model:
        """Return the model with this number moved.

        Raises
        ------
        RecipeError
            Where the number ends there.
        """
        effect = self.kind(model)
        own = {r: dict(v[self.effect]) for r, v in model.own.items() if self.effect in v}
        value = self.value(model) + by
        if self.recording is not None:
            own[self.recording][self.name] = value
        else:
            p = effect.parameter(self.name)
            if not p.low <= value <= p.high:
                raise RecipeError("out of bounds", where=self.name, value=value)
            effect = effect.with_parameters({self.name: value})
        return model.with_effect(effect, own)


Intervals = dict[str, dict[str, Estimate]]


def intervals(ws: Workspace, model: Model) -> Intervals:
    """Estimate of each number that the recordings share, by effect; model at the best fit."""
    out: Intervals = {e.name: {} for e in model.effects}
    slots = _slots(model)
    for slot, half in zip(slots, _half_widths(ws, model, slots), strict=True):
        if slot.recording is not None:
            continue
        value, p = slot.value(model), slot.kind(model).parameter(slot.name)
        known = np.isfinite(half)
        out[slot.effect][slot.name] = Estimate(
            value=value,
            low=float(max(value - half, p.low)) if known else None,
            high=float(min(value + half, p.high)) if known else None,
        )
    return out


def fitted_numbers(effect: Effect) -> list[str]:
    """Names of the shared numbers that a fit moves; not lists, phases of recordings, choices."""
    return [
        p.name
        for p in effect.searched()
        if p.owner == "instrument"
        and (getattr(effect, p.name) is not None)
        and p.name != "patch_mm"
    ]


def sandwich(slopes: Field, curvature: Field) -> Field:
    """Covariance A⁻¹ B A⁻¹ of parameters.

    Parameters
    ----------
    slopes : (p, n) score of each block
    curvature : (p, p) A, minus the Hessian of the sum
    """
    count, blocks = slopes.shape
    inverse = np.linalg.inv(curvature)
    meat = slopes @ slopes.T * (blocks / max(blocks - count, 1))
    return np.asarray(inverse @ meat @ inverse)


def _slots(model: Model) -> list[_Slot]:
    shared = [_Slot(effect=e.name, name=n) for e in model.effects for n in fitted_numbers(e)]
    with_numbers = {s.effect for s in shared}
    own = [
        _Slot(effect=effect, name=name, recording=recording)
        for recording, effects in model.own.items()
        for effect, values in effects.items()
        if effect in with_numbers
        for name in values
    ]
    return shared + own


def _half_widths(ws: Workspace, model: Model, slots: list[_Slot]) -> Field:
    """Half the width of each slot's interval; NaN where the data don't curve there."""
    half = np.full(len(slots), np.nan)
    if not slots:
        return half
    base = _blocks(ws, model)
    steps = np.array([s.step(model) for s in slots])
    for k, slot in enumerate(slots):
        steps[k] = _second_step(ws, model, slot, steps[k], base)
    sides: dict[int, tuple[Field, Field]] = {}
    for k, slot in enumerate(slots):
        both = _both_sides(ws, model, slot, steps[k])
        if both is not None and (both[0] + both[1] - 2 * base).sum() < 0:
            sides[k] = both
    kept = list(sides)
    if not kept:
        return half
    slopes = np.stack([(sides[k][0] - sides[k][1]) / 2 for k in kept])
    curvature = np.diag([-(sides[k][0] + sides[k][1] - 2 * base).sum() for k in kept])
    for i, one in enumerate(kept):
        for j, two in enumerate(kept[:i]):
            corner = _blocks(ws, slots[one].moved(slots[two].moved(model, steps[two]), steps[one]))
            mixed = corner - sides[one][0] - sides[two][0] + base
            curvature[i, j] = curvature[j, i] = -mixed.sum()
    if np.linalg.eigvalsh(curvature).min() <= 0:
        return half
    sd = np.sqrt(np.diag(sandwich(slopes, curvature))) * steps[kept]
    dof = max(base.size - len(kept), 1)
    half[kept] = sd * stats.t.ppf(0.5 + LEVEL / 2, dof)
    return half


def _second_step(
    ws: Workspace, model: Model, slot: _Slot, step: float, base: Field
) -> float:
    """Step at which the log density falls by half a nat, as far as the first one shows."""
    sides = _both_sides(ws, model, slot, step)
    if sides is None:
        return step
    fall = -float((sides[0] + sides[1] - 2 * base).sum())
    if fall <= 0:
        return step
    return float(step * np.clip(1 / np.sqrt(fall), 1 / FARTHER, FARTHER))


def _both_sides(
    ws: Workspace, model: Model, slot: _Slot, step: float
) -> tuple[Field, Field] | None:
    """Block sums a step ahead and a step back; None where the number ends."""
    try:
        return _blocks(ws, slot.moved(model, step)), _blocks(ws, slot.moved(model, -step))
    except RecipeError:
        return None


def _blocks(ws: Workspace, model: Model) -> Field:
    """Log density of each block, placements and level refitted."""
    levelled = ws.levelled(replace(model, level=1.0))
    return ws.block_scores(ws.log_densities(levelled))


def plain_values(values: Mapping[str, float]) -> dict[str, Estimate]:
    """Estimates without intervals."""
    return {name: Estimate(value=value) for name, value in values.items()}
