"""The log density about a fit: scores of blocks and curvature by numeric derivatives.

Each recording's placement and the noise's level are refitted at each value, so the log density is
the profile likelihood of the fitted numbers, a recording's own phase among them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fields import Field, Mask
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.predict.edges import on_edges
from files.errors import RecipeError
from sensors.effects.base import Effect

FIRST_STEP = 0.03
"""First step of the numeric derivatives, of the value; the second comes from the curvature."""
FARTHER = 30.0
"""Factor by which the second step may differ from the first, to either side."""
SHARES = (1.0, 0.5, 0.25)
"""Of Newton's step, tried in turn: where a number ends, or the log density isn't quadratic."""
TURN = 2 * math.pi


@dataclass(frozen=True, kw_only=True, slots=True)
class Number:
    """One fitted number: an effect's, or (recording) that recording's own of it."""

    effect: str
    name: str
    recording: int | None = None

    @property
    def is_phase(self) -> bool:
        """Whether it begins anew after a turn."""
        return self.name == "phase_rad"

    def kind(self, model: Model) -> Effect:
        """Return its effect."""
        return next(e for e in model.effects if e.name == self.effect)

    def value(self, model: Model) -> float:
        """Return its value in a model."""
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
        if self.is_phase:
            value %= TURN
        if self.recording is not None:
            own[self.recording][self.name] = value
        else:
            p = effect.parameter(self.name)
            if not p.low <= value <= p.high:
                raise RecipeError("out of bounds", where=self.name, value=value)
            effect = effect.with_parameters({self.name: value})
        return model.with_effect(effect, own)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Quadratic:
    """The log density about a model, in those numbers along which it curves.

    Attributes
    ----------
    steps : (p,) of the derivatives; slopes and curvature are per step
    slopes : (p, blocks)
    curvature : (p, p), minus the second derivative of the sum; positive definite
    total : log density of the model, nats
    """

    numbers: tuple[Number, ...]
    steps: Field
    slopes: Field
    curvature: Field
    total: float

    @property
    def newton(self) -> Field:
        """Move of each number to the maximum, (p,)."""
        return np.asarray(np.linalg.solve(self.curvature, self.slopes.sum(axis=1)) * self.steps)

    def climbed(self, ws: Workspace, model: Model, part: Sequence[Mask]) -> Model:
        """Return the model moved to the maximum, or as far as the part's log density rises."""
        for share in SHARES:
            try:
                moved = model
                for number, by in zip(self.numbers, self.newton, strict=True):
                    moved = number.moved(moved, share * float(by))
            except RecipeError:
                continue
            if float(_sums(ws, moved, [part]).sum()) > self.total:
                return ws.levelled(moved)
        return model

    @property
    def to_gain(self) -> float:
        """Nats that this move gains if the log density is quadratic."""
        slope = self.slopes.sum(axis=1)
        return 0.5 * float(slope @ np.linalg.solve(self.curvature, slope))


def numbers_of(model: Model, *, of: str | None = None) -> tuple[Number, ...]:
    """Numbers of a model that readings away from edges determine, or those of one effect.

    What lives on depth edges is left out: where an edge lies is no smooth function of the
    placement, and the log density of a few readings there has steps.
    """
    effects = [e for e in model.effects if not on_edges(e) and of in (None, e.name)]
    shared = [Number(effect=e.name, name=n) for e in effects for n in fitted_numbers(e)]
    known = {n.effect for n in shared}
    own = [
        Number(effect=effect, name=name, recording=recording)
        for recording, of_effects in model.own.items()
        for effect, values in of_effects.items()
        if effect in known
        for name in values
    ]
    return (*shared, *own)


def fitted_numbers(effect: Effect) -> list[str]:
    """Names of the shared numbers that a fit moves; not lists, phases of recordings, choices."""
    return [
        p.name
        for p in effect.searched()
        if p.owner == "instrument"
        and (getattr(effect, p.name) is not None)
        and p.name != "patch_mm"
    ]


def quadratic(ws: Workspace, model: Model) -> Quadratic | None:
    """Expand the log density about a model; None where it doesn't curve downwards."""
    return quadratics(ws, model, numbers_of(model), [ws.masks()])[0]


def quadratics(
    ws: Workspace,
    model: Model,
    numbers: Sequence[Number],
    parts: Sequence[Sequence[Mask]],
) -> list[Quadratic | None]:
    """Expand the log density of each part of the readings; all are computed in one go.

    Parameters
    ----------
    parts : for each part, for each patch (n, m) bool
    """
    base = _sums(ws, model, parts)
    sides: dict[Number, tuple[Field, Field]] = {}
    steps: dict[Number, float] = {}
    for number in numbers:
        step = _second_step(ws, model, number, base, parts)
        both = _both_sides(ws, model, number, step, parts)
        if both is not None:
            sides[number], steps[number] = both, step
    corners = {
        (one, two): _sums(ws, one.moved(two.moved(model, steps[two]), steps[one]), parts)
        for i, one in enumerate(sides)
        for two in list(sides)[:i]
    }
    return [
        _expanded(
            base[k], {n: (a[k], b[k]) for n, (a, b) in sides.items()},
            {pair: c[k] for pair, c in corners.items()}, steps,
        )
        for k in range(len(parts))
    ]  # fmt: skip


def _expanded(
    base: Field,
    sides: Mapping[Number, tuple[Field, Field]],
    corners: Mapping[tuple[Number, Number], Field],
    steps: Mapping[Number, float],
) -> Quadratic | None:
    """Differences of one part's block sums: base (blocks,), a step to each side, two steps."""
    kept = tuple(n for n, (a, b) in sides.items() if (a + b - 2 * base).sum() < 0)
    if not kept:
        return None
    slopes = np.stack([(sides[n][0] - sides[n][1]) / 2 for n in kept])
    curvature = np.diag([-float((sides[n][0] + sides[n][1] - 2 * base).sum()) for n in kept])
    for i, one in enumerate(kept):
        for j, two in enumerate(kept[:i]):
            mixed = corners[one, two] - sides[one][0] - sides[two][0] + base
            curvature[i, j] = curvature[j, i] = -mixed.sum()
    if np.linalg.eigvalsh(curvature).min() <= 0:
        return None
    return Quadratic(
        numbers=kept, steps=np.array([steps[n] for n in kept]), slopes=slopes,
        curvature=curvature, total=float(base.sum()),
    )  # fmt: skip


def _sums(ws: Workspace, model: Model, parts: Sequence[Sequence[Mask]]) -> Field:
    """Log density of each block of each part, (parts, blocks)."""
    levelled = ws.levelled(replace(model, level=1.0))
    densities = ws.log_densities(levelled)
    return np.stack([ws.block_scores(densities, masks) for masks in parts])


def _second_step(
    ws: Workspace,
    model: Model,
    number: Number,
    base: Field,
    parts: Sequence[Sequence[Mask]],
) -> float:
    """Step at which the log density falls by half a nat, as far as the first one shows."""
    step = number.step(model)
    sides = _both_sides(ws, model, number, step, parts)
    if sides is None:
        return step
    fall = -float((sides[0] + sides[1] - 2 * base).sum())
    if fall <= 0:
        return step
    return float(step * np.clip(1 / np.sqrt(fall), 1 / FARTHER, FARTHER))


def _both_sides(
    ws: Workspace,
    model: Model,
    number: Number,
    step: float,
    parts: Sequence[Sequence[Mask]],
) -> tuple[Field, Field] | None:
    """Block sums a step ahead and a step back; None where the number ends."""
    try:
        ahead, back = number.moved(model, step), number.moved(model, -step)
    except RecipeError:
        return None
    return _sums(ws, ahead, parts), _sums(ws, back, parts)
