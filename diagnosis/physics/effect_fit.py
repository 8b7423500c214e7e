"""Fit one effect beside the pose and the accepted effects: linear parts solved, others searched.

Where the mean is linear in an effect, its coefficients follow from generalised least squares on
whitened residuals, at each point of the grid of what isn't linear (variable projection, Golub and
Pereyra 1973). What acts on variance, tails or missing returns is searched on the full log density.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from diagnosis.components.row_periods import strongest_rows
from diagnosis.fields import Field, Mask
from diagnosis.model.log_density import Whitened
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.linear_fit import Fitted, has_fields, is_linear, solve_linear
from diagnosis.predict.prediction import starting
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.effects.base import Effect
from sensors.effects.form_error import FormError
from sensors.effects.pixel_locking import PixelLocking
from sensors.view.creases import concave_creases, filled_mm

MAX_GRID = 600
RADII_MM = (0.4, 0.8, 1.6, 3.2, 6.4)
FINER = (0.65, 0.75, 0.87, 1.15, 1.33, 1.5)
STRONGER = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Strengths from which a search goes on where the one found holds to the first order."""
PEAKS = 4
SMALL = 0.125
"""Share of its typical size from which a size is searched by factors."""


def fit_effect(
    kind: type[Effect],
    ws: Workspace,
    model: Model,
    states: Sequence[Whitened],
    *,
    masks: Sequence[Mask] | None = None,
    start: Effect | None = None,
    polish: bool = True,
    at_edges: bool = False,
) -> Fitted | None:
    """Fit an effect on top of a model; None where it can't act on these recordings.

    Parameters
    ----------
    masks : readings to fit on, those that suit the effect where left out
    start : the effect at which to begin, instead of its grid
    polish : search the nonlinear parameters beyond the grid
    at_edges : as a law of light and edges: of a part's form, its corners and not its waves
    """
    if kind is FormError and at_edges:
        return _fit_fillets(ws, model, polish)
    masks = list(masks) if masks is not None else ws.masks_for(start or kind)
    try:
        points = (start,) if start is not None else _grid(kind, ws, states)
    except (RecipeError, TypeError):
        return None
    if not points:
        return None
    # first-order fields are where to begin, no more
    if has_fields(points[0], ws) if start is None else is_linear(start, ws):
        found = _fit_linear(points, ws, model, states, masks, polish)
    else:
        found = _fit_searched(points, ws, model, masks, polish)
    if kind is FormError and start is None:
        filled = _fit_fillets(ws, model, polish)
        both = [f for f in (found, filled) if f is not None]
        found = max(both, key=lambda f: f.gain - f.free, default=None)
    return found


def _fit_fillets(ws: Workspace, model: Model, polish: bool) -> Fitted | None:
    """Fit one radius to the concave corners that are the better for it.

    Their readings are apart: what one radius gains is told for each corner by itself. A small one
    fills nothing but what counts as edge.
    """
    creases = concave_creases(ws.patches[0].view.scene)
    middles, corners = creases.middle_mm, len(creases.middle_mm)
    if corners == 0:
        return None
    still = ws.placements(model)
    base = ws.log_densities(model, placements=still)

    def fit(radius_mm: float) -> Fitted:
        everywhere = FormError(coefficients_um=(), fillet_mm=radius_mm)
        densities = ws.log_densities(model.with_effect(everywhere), placements=still)
        gains, doubt = np.zeros((2, corners + 1))
        for patch, mask, after, before in zip(ws.patches, ws.masks(), densities, base, strict=True):
            _, crease = filled_mm(patch.view, radius_mm)
            gains += np.bincount(crease[mask] + 1, (after - before)[mask], minlength=corners + 1)
            edge = mask & patch.edge
            # the nominal law may be off there by its noise
            at_edges = np.bincount(crease[edge] + 1, minlength=corners + 1)
            doubt += SETTINGS.physics.fillet_nats_each * at_edges
        better = np.flatnonzero(gains[1:] > SETTINGS.physics.fillet_nats + doubt[1:])
        silent = _as_silent(creases.turn_rad, gains[1:])
        which = tuple(float(v) for v in middles[np.union1d(better, silent)].ravel())
        effect = replace(everywhere, fillet_mm=radius_mm if better.size else 0.0, corners_mm=which)
        gain = float(gains[1:][better].sum())
        return Fitted(effect=effect, own={}, gain=gain, free=1 + better.size)

    tried = {r: fit(r) for r in RADII_MM}
    best = max(tried, key=lambda r: tried[r].gain - tried[r].free)
    if polish and not tried[best].effect.is_null:
        tried |= {best * s: fit(best * s) for s in FINER}
    found = max(tried.values(), key=lambda f: f.gain - f.free)
    if not polish or found.effect.is_null:
        return found
    # the placement compensates a missing fillet, so that it changes with the radius
    finer = _fit_searched((found.effect,), ws, model, ws.masks(), True)
    return found if finer is None else replace(finer, free=found.free)


def _as_silent(turn_rad: Field, gains: Field) -> NDArray[np.int64]:
    """Creases without readings whose angle is that of creases with a fillet.

    One maker's tool rounds corners of one kind; where a corner of that kind is sharp, none is
    presumed.
    """
    least = SETTINGS.physics.fillet_nats
    apart_rad = math.radians(SETTINGS.physics.corners_alike_deg)
    rounded, sharp = gains > least, gains < -least
    alike = np.abs(turn_rad[:, None] - turn_rad[None]) < apart_rad
    kind = alike[:, rounded].any(axis=1) & ~alike[:, sharp].any(axis=1)
    return np.flatnonzero(kind & ~rounded & ~sharp)


def _grid(kind: type[Effect], ws: Workspace, states: Sequence[Whitened]) -> tuple[Effect, ...]:
    effect = starting(kind, ws.patches[0].view)
    longest = max(ws.patches, key=lambda p: p.shape[0])
    unstated = longest.view.datasheet.camera_rows is None
    if isinstance(effect, PixelLocking) and effect.rows is None and unstated:
        return _row_counts(effect, ws, states)
    points = effect.starts(longest.view)
    step = max(1, math.ceil(len(points) / MAX_GRID))
    return points[::step]


def _row_counts(
    effect: Effect, ws: Workspace, states: Sequence[Whitened]
) -> tuple[Effect, ...]:
    """Put pixel locking at the numbers of camera rows with which the readings ripple most."""
    p = effect.parameter("rows")
    found = strongest_rows(ws.patches, states, ws.masks_for(type(effect)), 2 * PEAKS)
    return tuple(effect.with_parameters(rows=rows) for rows in found if p.low <= rows <= p.high)


def _fit_linear(
    points: Sequence[Effect],
    ws: Workspace,
    model: Model,
    states: Sequence[Whitened],
    masks: Sequence[Mask],
    polish: bool,
) -> Fitted | None:
    solved: list[tuple[Fitted, Effect]] = []
    for point in points:
        fitted = solve_linear(point, ws, states, masks)
        if fitted is None:
            return None
        last = solved[-1][0] if solved else fitted
        solved.append((fitted, point))
        if fitted.free > last.free and fitted.gain - fitted.free < last.gain - last.free:
            break  # more numbers must gain what they cost, or yet more of them are no use
    best, point = max(solved, key=lambda s: s[0].gain - s[0].free)
    names = [p.name for p in point.searched(linear=False) if _moves(p.name, point)]
    if polish and names:
        best = _polish_linear(point, names, ws, states, masks, best)
    if best.effect.first_order and not best.effect.is_null:
        return _fit_searched(_larger(best.effect), ws, model, masks, polish)
    return best


def _larger(effect: Effect) -> tuple[Effect, ...]:
    """Put an effect at the strength found, which holds to the first order, and at some above it."""
    strength = next(p for p in effect.parameters() if p.linear)
    found = getattr(effect, strength.name)
    sizes = sorted({min(s * found, strength.high) for s in STRONGER})
    return tuple(effect.with_parameters({strength.name: size}) for size in sizes)


def _moves(name: str, effect: Effect) -> bool:
    """Whether a nonlinear parameter is worth a search: shared, and not a phase."""
    p = effect.parameter(name)
    unknown = getattr(effect, name) is None
    return p.owner == "instrument" and name != "phase_rad" and not unknown


def _polish_linear(
    point: Effect,
    names: Sequence[str],
    ws: Workspace,
    states: Sequence[Whitened],
    masks: Sequence[Mask],
    first: Fitted,
) -> Fitted:
    bounds = [_bounds(point, n, ws) for n in names]
    start = np.array([_number(point, n) for n in names])
    scale = np.maximum(np.abs(start), 1e-6)
    spread = _spread(point, names, ws)

    best = first

    def cost(steps: Field) -> float:
        nonlocal best
        values = {
            n: float(np.clip(s + d * w, *b))
            for n, s, d, w, b in zip(names, start, steps, scale * spread, bounds, strict=True)
        }
        fitted = solve_linear(point.with_parameters(values), ws, states, masks)
        if fitted is None:
            return 0.0
        if fitted.gain > best.gain:
            best = fitted
        return -fitted.gain

    _search(cost, len(names), most=14 * len(names) + 8, step=0.01, nats=0.05)
    return best


def _search(
    cost: Callable[[Field], float], size: int, *, most: int, step: float, nats: float
) -> None:
    """Let a simplex of unit steps look for the least cost; `cost` keeps the best it has seen.

    Parameters
    ----------
    most : evaluations
    step, nats : a simplex so small, and so level, is settled
    """
    minimize(
        cost,
        np.zeros(size),
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([np.zeros(size), np.eye(size)]),
            "maxfev": most,
            "xatol": step,
            "fatol": nats,
        },
    )


def _bounds(effect: Effect, name: str, ws: Workspace) -> tuple[float, float]:
    """Bounds of a parameter; a wave has some cycles in the longest scan."""
    p, wave = effect.parameter(name), _of_a_wave(effect, name)
    if wave == "frequency":
        return max(p.low, SETTINGS.least_cycles / _longest(ws, "time_s")), p.high
    if wave == "period":
        return p.low, min(p.high, _longest(ws, "travel_mm") / SETTINGS.least_cycles)
    return p.low, p.high


def _of_a_wave(effect: Effect, name: str) -> str:
    """Return "frequency" or "period" where a parameter is that of a wave over profiles, else ""."""
    forms = [r for r in effect.relaxed if r.each == "profile"]
    if any(r.frequency == name for r in forms):
        return "frequency"
    return "period" if any(r.period == name for r in forms) else ""


def _longest(ws: Workspace, axis: str) -> float:
    """Length of the longest recording along an axis of its views, whatever strips are looked at."""
    ends: dict[int, Field] = {}
    for patch in ws.patches:
        before = ends.get(patch.recording, np.empty(0))
        ends[patch.recording] = np.append(before, getattr(patch.view, axis)[[0, -1]])
    return max(max(float(np.ptp(values)) for values in ends.values()), 1e-9)


def _spread(point: Effect, names: Sequence[str], ws: Workspace) -> Field:
    """Relative first step of each nonlinear parameter; fine for frequencies."""
    out = []
    for name in names:
        wave = _of_a_wave(point, name)
        if wave == "frequency":
            out.append(0.2 / _longest(ws, "time_s") / max(_number(point, name), 1e-9))
        elif wave == "period":
            out.append(0.2 * _number(point, name) / _longest(ws, "travel_mm"))
        elif name == "rows":
            out.append(0.3 / max(_number(point, name), 1e-9))
        elif name.endswith("_rows"):
            out.append(0.15 / max(abs(_number(point, name)), 1e-6))
        else:
            out.append(0.3)
    return np.array(out)


def _number(effect: Effect, name: str) -> float:
    value = getattr(effect, name)
    return _typical(effect, name) if value is None else float(value)


def _typical(effect: Effect, name: str) -> float:
    typical = effect.parameter(name).typical
    return float(typical) if isinstance(typical, int | float) else 1.0


def _fit_searched(
    points: Sequence[Effect],
    ws: Workspace,
    model: Model,
    masks: Sequence[Mask],
    polish: bool,
) -> Fitted | None:
    """Search on the full log density: grid first, then a simplex."""
    # what leaves the mean alone leaves the placement alone
    moves = {"mean"} & {*points[0].channels, *points[0].secondary_channels}
    still = None if moves else ws.placements(model)

    def total(trial: Model) -> float:
        level = ws.levelled(trial, placements=still)
        return float(ws.block_scores(ws.log_densities(level, placements=still), masks).sum())

    reference = total(model)
    scored: list[tuple[float, Effect]] = []
    for point in points:
        try:
            scored.append((total(model.with_effect(point)) - reference, point))
        except RecipeError:
            return None
    gain, best = max(scored, key=lambda s: s[0])
    names = [p.name for p in best.searched() if p.owner == "instrument"]
    if not polish or not names:
        return Fitted(effect=best, own={}, gain=gain, free=max(len(names), 1))
    start = np.array([_number(best, n) for n in names])
    typical = np.array([abs(_typical(best, n)) for n in names])
    step = np.maximum(np.maximum(0.4 * np.abs(start), 0.05 * typical), 1e-4)
    # sizes may be wrong by a factor: threshold and matt part of a gloss lie along a valley
    sizes = (start >= SMALL * typical) & [best.parameter(n).low >= 0 for n in names] & (start > 0)
    top = (gain, best)

    def cost(u: Field) -> float:
        nonlocal top
        there = np.where(sizes, start * np.exp(np.clip(0.4 * u, -9, 9)), start + u * step)
        values = {
            n: float(np.clip(v, best.parameter(n).low, best.parameter(n).high))
            for n, v in zip(names, there, strict=True)
        }
        try:
            trial = best.with_parameters(values)
            value = total(model.with_effect(trial)) - reference
        except RecipeError:
            return 0.0
        if value > top[0]:
            top = (value, trial)
        return -value

    _search(cost, len(names), most=5 * len(names) ** 2 + 15, step=0.02, nats=0.3)
    return Fitted(effect=top[1], own={}, gain=top[0], free=len(names))

