"""What the mean is linear in, solved beside the placement by generalised least squares.

Whitened readings, the placement's columns projected out; a wave's phase may be each recording's
own, columns are shrunk by their own scatter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.fields import Field, Mask, Single
from diagnosis.model.log_density import Whitened
from diagnosis.model.workspace import Workspace
from diagnosis.physics.column_offsets import column_equations, likely_variance
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.effects.base import Effect
from sensors.effects.sinusoid import SinusoidalEffect

ROUNDS = 2
PLACED_BY = 16_000
"""Readings of a recording that settle its placement while coefficients are tried."""


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


def has_fields(effect: Effect, ws: Workspace) -> bool:
    """Whether the mean is linear in something, to the first order at least."""
    return _basis(effect, ws, 0) is not None


def is_linear(effect: Effect, ws: Workspace) -> bool:
    """Whether the mean is linear in something, however strong the effect."""
    return not effect.first_order and has_fields(effect, ws)


def solve_linear(
    effect: Effect, ws: Workspace, states: Sequence[Whitened], masks: Sequence[Mask]
) -> Fitted | None:
    """Solve the linear coefficients at given nonlinear parameters."""
    if effect.name == "column_offset":
        return _solve_columns(effect, ws, states, masks)
    rows = _rows(effect, ws, states, masks)
    if rows is None or not any(np.any(r.white) for r in rows.values()):
        return None
    found = _robust(effect, rows)
    solved, own = _with(effect, found, rows)
    held = {r: _coefficients_of(solved, own.get(r, {})) for r in rows}
    gain = sum(row.gain(held[r]) for r, row in rows.items())
    linear = len(next(iter(found.values())))
    nonlinear = len([p for p in effect.parameters() if p.grid or p.name == "rows"])
    return Fitted(
        effect=solved, own=own, gain=gain,
        free=2 + len(own) if own else linear + nonlinear,
    )  # fmt: skip


def _robust(effect: Effect, rows: Mapping[int, "_Rows"]) -> dict[int, Field]:
    """Coefficients for each recording, readings that stay far off left aside.

    A misfit is large before it is fitted, and a field may be large where it has no say: both the
    readings that are near without the effect and all of them serve as a start.
    """
    best: tuple[float, dict[int, Field]] | None = None
    for start in (
        {r: np.ones(row.values.size, dtype=bool) for r, row in rows.items()},
        {r: np.abs(row.unfitted) < SETTINGS.clip for r, row in rows.items()},
    ):
        near = start
        for _ in range(ROUNDS):
            found = _coefficients(effect, rows, near)
            left = {r: row.left(found[r]) for r, row in rows.items()}
            near = {r: np.abs(rest) < SETTINGS.clip for r, rest in left.items()}
        cost = sum(_cost(rest) for rest in left.values())
        if best is None or cost < best[0]:
            best = cost, found
    assert best is not None
    return best[1]


def phase_is_own(effect: Effect) -> bool:
    """Whether each recording has its own phase."""
    if not isinstance(effect, SinusoidalEffect):
        return False
    return effect.parameter("phase_rad").owner == "recording"


def within_bounds(effect: Effect, coefficients: Field) -> Effect:
    """Put linear coefficients into an effect, held within its bounds."""
    linear = [p for p in effect.parameters() if p.linear]
    if isinstance(effect, SinusoidalEffect):
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rows:
    """Whitened readings of one recording.

    Attributes
    ----------
    white : (N, k), the effect's fields
    columns : (N, 9), the placement's
    values : (N,), the residual
    """

    white: Single
    columns: Single
    values: Single

    def normal(self, weight: Single) -> tuple[Field, Field, Field]:
        """Return normal matrix and right side beyond the placement, and squares before that."""
        white, columns = weight[:, None] * self.white, weight[:, None] * self.columns
        gram = (white.T @ self.white).astype(np.float64)
        cross = (columns.T @ self.white).astype(np.float64)
        pose = np.eye(cross.shape[0]) + (columns.T @ self.columns).astype(np.float64)
        right = np.column_stack([cross, columns.T @ self.values])
        solved = np.linalg.solve(pose, right)
        return (
            gram - cross.T @ solved[:, :-1],
            white.T @ self.values - cross.T @ solved[:, -1],
            np.diag(gram),
        )

    @cached_property
    def unfitted(self) -> Single:
        """Residual (N,) without the fields."""
        return self.left(np.zeros(self.white.shape[1]))

    def left(self, beta: Field) -> Single:
        """Residual (N,) once the fields are taken off and the placement is fitted anew.

        Nine numbers need no more than some of the readings.
        """
        rest = self.values - self.white @ beta.astype(np.float32)
        every = max(1, rest.size // PLACED_BY)
        columns, values = self.columns[::every], rest[::every]
        found = []
        # the fields may hold much that the placement takes back, or spoil it where they fail
        for near in (np.abs(values) < SETTINGS.clip, np.ones(values.size, dtype=bool)):
            for _ in range(2):
                own = columns[near]
                pose = np.eye(columns.shape[1]) / every + (own.T @ own).astype(np.float64)
                placement = np.linalg.solve(pose, own.T @ values[near]).astype(np.float32)
                near = np.abs(values - columns @ placement) < SETTINGS.clip
            found.append(placement)
        best = min(found, key=lambda f: _cost(values - columns @ f))
        return np.asarray(rest - self.columns @ best)

    def gain(self, beta: Field) -> float:
        """Nats that the fields gain, readings far off counting as spikes."""
        return _cost(self.unfitted) - _cost(self.left(beta))


def _cost(left: Single) -> float:
    """Nats that residuals cost, each one `clip` deviations at most."""
    return 0.5 * float(np.minimum(np.square(left), SETTINGS.clip**2).sum(dtype=np.float64))


def _rows(
    effect: Effect, ws: Workspace, states: Sequence[Whitened], masks: Sequence[Mask]
) -> dict[int, _Rows] | None:
    """Whiten an effect's fields on every recording; None where it has none."""
    parts: dict[int, list[tuple[Single, Single, Single]]] = {}
    for k, (patch, state, mask) in enumerate(zip(ws.patches, states, masks, strict=True)):
        fields = _basis(effect, ws, k)
        if fields is None:
            return None
        pick = mask & state.used
        white = np.empty((int(pick.sum()), len(fields)), dtype=np.float32)
        for f, field in enumerate(fields):
            white[:, f] = state.whiten(field)[pick]
        farthest = 3 * SETTINGS.clip
        values = np.clip(state.innovations[pick], -farthest, farthest).astype(np.float32)
        columns = state.columns[pick].astype(np.float32)
        parts.setdefault(patch.recording, []).append((white, columns, values))
    return {
        r: _Rows(
            white=np.concatenate([w for w, _, _ in own]),
            columns=np.concatenate([c for _, c, _ in own]),
            values=np.concatenate([v for _, _, v in own]),
        )
        for r, own in parts.items()
    }


def _coefficients(
    effect: Effect, rows: Mapping[int, _Rows], near: Mapping[int, Mask]
) -> dict[int, Field]:
    """Coefficients for each recording: the same for all but where a wave's phase is its own."""
    normals = {r: row.normal(near[r].astype(np.float32)) for r, row in rows.items()}
    if phase_is_own(effect):
        return {r: _solve(*normal) for r, normal in normals.items()}
    gram, right, raw = (np.asarray(sum(n[k] for n in normals.values())) for k in range(3))
    if any(p.linear and p.kind == "list" for p in effect.parameters()):
        # many alike: what the placement can imitate is no larger than the others
        gram = gram + np.eye(right.size) / likely_variance(gram, right)
    elif not isinstance(effect, SinusoidalEffect):
        gram = gram + np.diag(_precision(effect))
    return dict.fromkeys(rows, _solve(gram, right, raw))


def _precision(effect: Effect) -> Field:
    """Inverse variance of each coefficient before anything is measured: half its bounds."""
    return np.array(
        [(0.5 * max(abs(p.low), abs(p.high))) ** -2 for p in effect.parameters() if p.linear]
    )


def _with(
    effect: Effect, found: Mapping[int, Field], rows: Mapping[int, _Rows]
) -> tuple[Effect, dict[int, dict[str, float]]]:
    """Put coefficients into the effect; a wave's amplitude is shared, its phases are not."""
    if not phase_is_own(effect):
        return within_bounds(effect, next(iter(found.values()))), {}
    amplitude = next(p for p in effect.parameters() if p.linear)
    weights = [float(np.square(row.white).sum()) for row in rows.values()]
    shared = float(np.average([np.hypot(*b) for b in found.values()], weights=weights))
    own = {
        r: {"phase_rad": float(np.arctan2(b[1], b[0]) % (2 * np.pi))} for r, b in found.items()
    }
    return effect.with_parameters({amplitude.name: min(shared, amplitude.high)}), own


def _coefficients_of(effect: Effect, own: Mapping[str, float]) -> Field:
    return np.asarray(effect.with_parameters(own).coefficients() if own else effect.coefficients())


def _solve(gram: Field, right: Field, raw: Field) -> Field:
    """Solve for coefficients; directions that a placement can imitate stay at zero.

    Such a direction keeps less than a millionth of its square once the pose is projected out:
    the recordings can't tell it from a misplaced part.
    """
    size = np.sqrt(np.maximum(raw, 1e-30))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    kept = values > SETTINGS.imitated
    half = vectors[:, kept] / np.sqrt(values[kept])
    return np.asarray((half @ (half.T @ (right / size))) / size)


def _solve_columns(
    effect: Effect, ws: Workspace, states: Sequence[Whitened], masks: Sequence[Mask]
) -> Fitted:
    tilted = column_equations(ws.patches, states, masks, tilted=True)
    values, gain, evidence = tilted.level().shrunk()
    slopes: Field = np.zeros(0)
    with_slopes, more, better = tilted.shrunk()
    if better > evidence + SETTINGS.physics.tilt_nats:
        (values, slopes), gain = np.split(with_slopes, 2), more
        slopes = slopes - slopes.mean()
    return Fitted(
        effect=effect.with_parameters(
            values_um=_listed(effect, "values_um", 1e3 * (values - values.mean())),
            scales_ppm=_listed(effect, "scales_ppm", 1e6 * slopes),
            rms_um=0.0,
        ),
        own={},
        gain=gain,
        free=(values.size + slopes.size) // 2,
    )


def _listed(effect: Effect, name: str, values: Field) -> tuple[float, ...]:
    bounds = effect.parameter(name)
    return tuple(np.clip(values, bounds.low, bounds.high).tolist())
