"""What the mean is linear in, solved beside the placement by generalised least squares.

Whitened readings, the placement's columns projected out; a wave's phase may be each recording's
own, columns are shrunk by their own scatter.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.columnwise import column_equations
from diagnosis.noise import Field, Mask
from diagnosis.score import CLIP, Whitened
from diagnosis.workspace import Workspace
from sensors.effects.base import Effect
from sensors.typed_yaml import RecipeError

IMITATED = 1e-6


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Fitted:
    """An effect at its best parameters.

    Attributes
    ----------
    own : parameters of each recording
    gain : nats gained on the fitted readings, by the quadratic approximation or the full density
    free : how many numbers were fitted
    """

    effect: Effect
    own: Mapping[int, Mapping[str, float]]
    gain: float
    free: int


def linear_count(effect: Effect, ws: Workspace) -> int:
    """How many fields the mean is linear in; 0 where it isn't."""
    basis = _basis(effect, ws, 0)
    return 0 if basis is None else len(basis)


def solve_linear(
    effect: Effect, ws: Workspace, states: Sequence[Whitened], masks: Sequence[Mask]
) -> Fitted | None:
    """Solve the linear coefficients at given nonlinear parameters."""
    if effect.name == "column_offset":
        return _solve_columns(effect, ws, states, masks)
    normals = _normals(effect, ws, states, masks)
    if normals is None:
        return None
    if phase_is_own(effect):
        return _solve_phases(effect, normals)
    gram = np.asarray(sum(n.gram for n in normals.values()))
    right = np.asarray(sum(n.right for n in normals.values()))
    raw = np.asarray(sum(n.raw for n in normals.values()))
    if not np.any(np.diag(gram) > 1e-12):
        return None
    beta = _solve(gram, right, raw)
    solved = within_bounds(effect, beta)
    held = beta if solved.sinusoid else solved.coefficients()
    gain = float(right @ held - 0.5 * held @ gram @ held)
    count = len(beta) + len([p for p in effect.parameters() if p.grid or p.name == "rows"])
    return Fitted(effect=solved, own={}, gain=gain, free=count)


def phase_is_own(effect: Effect) -> bool:
    """Whether each recording has its own phase."""
    return effect.sinusoid and effect.parameter("phase_rad").owner == "recording"


def within_bounds(effect: Effect, coefficients: Field) -> Effect:
    """Put linear coefficients into an effect, held within its bounds."""
    linear = [p for p in effect.parameters() if p.linear]
    if effect.sinusoid:
        high = linear[0].high
        return effect.with_parameters(
            {
                linear[0].name: float(min(np.hypot(*coefficients), high)),
                "phase_rad": float(np.arctan2(coefficients[1], coefficients[0]) % (2 * np.pi)),
            }
        )
    given = [float(c) for c in coefficients]
    values: dict[str, object] = {}
    for p in linear:
        if p.kind == "list":
            count = len(getattr(effect, p.name))
            values[p.name] = tuple(float(np.clip(c, p.low, p.high)) for c in given[:count])
            given = given[count:]
        else:
            values[p.name] = float(np.clip(given.pop(0), p.low, p.high))
    return effect.with_parameters(values)


def _basis(effect: Effect, ws: Workspace, patch: int) -> list[Field] | None:
    try:
        basis = effect.basis(ws.patches[patch].view)
    except RecipeError:
        return None
    if basis is None or not basis.fields:
        return None
    shape = ws.patches[patch].shape
    return [np.broadcast_to(np.asarray(f, dtype=np.float64), shape) for f in basis.fields]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Normal:
    """Normal equations of one recording, pose projected out."""

    gram: Field
    right: Field
    raw: Field


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Ready:
    """What a patch's fits share: the readings picked, the pose's columns and their products."""

    pick: Mask
    columns: Field
    values: Field
    gram: Field
    right: Field


def _ready(state: Whitened, mask: Mask) -> _Ready:
    key = id(mask)
    held = state.kept.get(key)
    if isinstance(held, tuple) and held[0] is mask:
        kept: _Ready = held[1]
        return kept
    pick = mask & state.used
    columns = state.columns[pick].astype(np.float32)
    # wide: a large misfit is what is being fitted; spikes are out already
    values = np.clip(state.innovations[pick], -3 * CLIP, 3 * CLIP).astype(np.float32)
    wide = columns.astype(np.float64)
    ready = _Ready(
        pick=pick, columns=columns, values=values, gram=wide.T @ wide, right=wide.T @ values
    )
    state.kept[key] = (mask, ready)
    return ready


def _normals(
    effect: Effect, ws: Workspace, states: Sequence[Whitened], masks: Sequence[Mask]
) -> dict[int, _Normal] | None:
    """Whitened normal equations of an effect's coefficients for each recording."""
    gram: dict[int, Field] = {}
    cross: dict[int, Field] = {}
    right: dict[int, Field] = {}
    pose: dict[int, Field] = {}
    pose_right: dict[int, Field] = {}
    for k, (patch, state, mask) in enumerate(zip(ws.patches, states, masks, strict=True)):
        fields = _basis(effect, ws, k)
        if fields is None:
            return None
        ready = _ready(state, mask)
        white = np.empty((ready.values.size, len(fields)), dtype=np.float32)
        for f, field in enumerate(fields):
            white[:, f] = state.whiten(field)[ready.pick]
        r = patch.recording
        gram[r] = gram.get(r, 0.0) + (white.T @ white).astype(np.float64)
        cross[r] = cross.get(r, 0.0) + (ready.columns.T @ white).astype(np.float64)
        right[r] = right.get(r, 0.0) + (white.T @ ready.values).astype(np.float64)
        pose[r] = pose.get(r, np.eye(ready.gram.shape[0])) + ready.gram
        pose_right[r] = pose_right.get(r, 0.0) + ready.right
    out = {}
    for r in gram:
        solved = np.linalg.solve(pose[r], np.column_stack([cross[r], pose_right[r]]))
        out[r] = _Normal(
            gram=gram[r] - cross[r].T @ solved[:, :-1],
            right=right[r] - cross[r].T @ solved[:, -1],
            raw=np.diag(gram[r]),
        )
    return out


def _solve(gram: Field, right: Field, raw: Field) -> Field:
    """Solve for coefficients; directions that a placement can imitate stay at zero.

    Such a direction keeps less than a millionth of its square once the pose is projected out:
    the recordings can't tell it from a misplaced part.
    """
    size = np.sqrt(np.maximum(raw, 1e-30))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    kept = values > IMITATED
    half = vectors[:, kept] / np.sqrt(values[kept])
    return np.asarray((half @ (half.T @ (right / size))) / size)


def _solve_columns(
    effect: Effect, ws: Workspace, states: Sequence[Whitened], masks: Sequence[Mask]
) -> Fitted:
    offsets, gain = column_equations(ws.patches, states, masks).offsets()
    um = tuple(float(v) for v in np.clip(1e3 * (offsets - offsets.mean()), -1000, 1000))
    return Fitted(
        effect=effect.with_parameters(values_um=um, rms_um=0.0),
        own={},
        gain=gain,
        free=len(um) // 2,
    )


def _solve_phases(effect: Effect, normals: Mapping[int, _Normal]) -> Fitted | None:
    amplitude = [p.name for p in effect.parameters() if p.linear][0]
    own: dict[int, dict[str, float]] = {}
    sizes, weights = [], []
    for r, normal in normals.items():
        if np.trace(normal.gram) <= 1e-12:
            continue
        beta = _solve(normal.gram, normal.right, normal.raw)
        own[r] = {"phase_rad": float(np.arctan2(beta[1], beta[0]) % (2 * np.pi))}
        sizes.append(float(np.hypot(*beta)))
        weights.append(float(np.trace(normal.gram)))
    if not own:
        return None
    shared = float(np.average(sizes, weights=weights))
    gain = 0.0
    for r, values in own.items():
        phase = values["phase_rad"]
        beta = shared * np.array([math.cos(phase), math.sin(phase)])
        gain += float(normals[r].right @ beta - 0.5 * beta @ normals[r].gram @ beta)
    high = effect.parameter(amplitude).high
    return Fitted(
        effect=effect.with_parameters({amplitude: min(shared, high)}),
        own=own,
        gain=gain,
        free=2 + len(own),
    )
