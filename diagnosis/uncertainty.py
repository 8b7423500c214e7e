"""95 % intervals of the parameters: sandwich of block scores around numeric curvature."""

import numpy as np

from diagnosis.noise import Field
from diagnosis.workspace import Model, Workspace
from sensors.effects.base import Effect
from sensors.typed_yaml import RecipeError

REACH = 2.4
"""Deviations to each side: 1.96 of a normal, widened for what block scores can't know."""
Intervals = dict[str, dict[str, tuple[float, float, float]]]


def intervals(ws: Workspace, model: Model) -> Intervals:
    """Value, low and high of each fitted number of each effect."""
    slots = [(e.name, n) for e in model.effects for n in fitted_numbers(e)]
    out: Intervals = {e.name: {} for e in model.effects}
    if not slots:
        return out
    centre = np.array([_value(_effect(model, e), n) for e, n in slots])
    steps = np.array(
        [_step(_effect(model, e), n, v) for (e, n), v in zip(slots, centre, strict=True)]
    )
    base = ws.block_scores(ws.log_densities(model))
    ahead, back = [], []
    for k in range(len(slots)):
        ahead.append(_moved(ws, model, slots[k], centre[k] + steps[k], base))
        back.append(_moved(ws, model, slots[k], centre[k] - steps[k], base))
    slopes = np.stack([(a - b) / 2 for a, b in zip(ahead, back, strict=True)])
    curve = np.array([-(a + b - 2 * base).sum() for a, b in zip(ahead, back, strict=True)])
    meat = slopes @ slopes.T
    # curvature between different effects' parameters is taken from the scores themselves
    size = np.sqrt(np.maximum(np.diag(meat), 1e-12))
    bread = np.maximum(curve, 1e-6)
    correlation = meat / np.outer(size, size)
    inverse = np.linalg.pinv(0.98 * correlation + 0.02 * np.eye(len(slots)))
    for k, (effect, name) in enumerate(slots):
        own = np.sqrt(meat[k, k]) / bread[k]
        naive = 1 / np.sqrt(bread[k])
        sd = max(own, naive) * np.sqrt(np.clip(inverse[k, k], 1.0, 25.0)) * steps[k]
        p = _effect(model, effect).parameter(name)
        value = float(centre[k])
        out[effect][name] = (
            value,
            float(max(value - REACH * sd, p.low)),
            float(min(value + REACH * sd, p.high)),
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


def _effect(model: Model, name: str) -> Effect:
    return next(e for e in model.effects if e.name == name)


def _value(effect: Effect, name: str) -> float:
    return float(getattr(effect, name))


def _step(effect: Effect, name: str, value: float) -> float:
    if name == "frequency_hz":
        return 0.02
    typical = effect.parameter(name).typical
    size = abs(value) if value else abs(float(typical or 1.0))
    return float(max(0.03 * size, 1e-6))


def _moved(ws: Workspace, model: Model, slot: tuple[str, str], value: float, base: Field) -> Field:
    effect = _effect(model, slot[0])
    p = effect.parameter(slot[1])
    try:
        changed = effect.with_parameters({slot[1]: float(np.clip(value, p.low, p.high))})
    except RecipeError:
        return base
    kept = {r: dict(v[slot[0]]) for r, v in model.own.items() if slot[0] in v}
    return ws.block_scores(ws.log_densities(model.with_effect(changed, kept)))
