"""The normal equations of all components: whitened once, then everything is linear algebra.

Readings are whitened under the calibrated noise; each recording's placement is projected out with
its prior. What is left of X'X and X'y is summed over recordings. Values for each profile and for
each column are indicators whose whitened form is sparse; they are built from combs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.ndimage import uniform_filter

from diagnosis.components.component import Component, mean_columns
from diagnosis.components.smooth import Ranges
from diagnosis.evidence.posterior import Equations
from diagnosis.noise import Mask, NoiseModel, mad_sd
from diagnosis.patch import Patch
from diagnosis.score import Whitened
from diagnosis.settings import SETTINGS, Settings
from sensors.view.covariates import COVARIATES

Floats = NDArray[np.float64]
IMITATED = 1e-6
"""Energy per reading below which a component is what a placement imitates: nothing is left."""
COMB = 8
"""Spacing of a comb's teeth: a whitened tooth reaches over 4 profiles and 6 columns."""
REACH = (4, 6)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Block:
    """Columns of one component, of one recording's own where it has such.

    Attributes
    ----------
    turn : what they were made of the component's columns by
    """

    component: Component
    recording: int | None
    columns: slice
    turn: Floats | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Gram:
    """Normal equations beyond the placements.

    Attributes
    ----------
    blocks : whose each column is
    matrix, right : X'X and X'y
    square : y'y beyond the placements
    readings : how many
    """

    blocks: tuple[Block, ...]
    matrix: Floats
    right: Floats
    square: float
    readings: int


def taken(patch: Patch, state: Whitened) -> tuple[Mask, Floats]:
    """Which readings count, and by what weight: edges by what their scatter shows."""
    weight = np.ones(patch.shape)
    at_edge = state.used & patch.edge
    if at_edge.any():
        loud = max(mad_sd(state.innovations[at_edge]), 1.0)
        weight[patch.edge] = 1.0 / loud
    return state.used, weight


def tamed(innovations: Floats, used: Mask) -> Floats:
    """Innovations (n, m), each at most `clip` deviations off its neighbours' mean."""
    share = np.maximum(uniform_filter(used.astype(float), 5, mode="constant"), 1e-9)
    middle = uniform_filter(np.where(used, innovations, 0.0), 5, mode="constant") / share
    middle = np.where(np.abs(middle) > 1.0, middle, 0.0)
    return middle + np.clip(innovations - middle, -SETTINGS.clip, SETTINGS.clip)


def gram_of(
    components: Sequence[Component],
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    ranges: Ranges,
    noise: NoiseModel,
) -> Gram:
    """Sum the normal equations of all components over recordings."""
    dense = [c for c in components if not c.relaxed.each and not c.own]
    own = [c for c in components if c.own or c.relaxed.each == "profile"]
    columns = [c for c in components if c.relaxed.each == "column"]
    numbers = sorted({p.recording for p in patches})
    # columns of shared components on all patches, in the same order; scaled alike
    fields = {c.name: [mean_columns(c, p, ranges, noise) for p in patches] for c in dense}
    fields = {n: f for n, f in fields.items() if all(x for x in f)}
    dense = [c for c in dense if c.name in fields]
    white: dict[int, list[tuple[Floats, Floats, Floats, list[sparse.csr_matrix]]]] = {}
    blocks: list[Block] = []
    at = 0
    for c in dense:
        k = len(fields[c.name][0])
        blocks.append(Block(component=c, recording=None, columns=slice(at, at + k)))
        at += k
    width = patches[0].shape[1]
    for c in columns:
        blocks.append(Block(component=c, recording=None, columns=slice(at, at + width)))
        at += width
    shared = at
    own_size: dict[int, int] = {}
    for number in numbers:
        members = [k for k, p in enumerate(patches) if p.recording == number]
        start = at
        for c in own:
            k = _own_size(c, [patches[m] for m in members])
            blocks.append(Block(component=c, recording=number, columns=slice(at, at + k)))
            at += k
        own_size[number] = at - start
    matrix, right, square, readings = np.zeros((at, at)), np.zeros(at), 0.0, 0
    start = shared
    for number in numbers:
        members = [k for k, p in enumerate(patches) if p.recording == number]
        g, r, s, n = _of_recording(
            members, patches, states, dense, columns, own, fields, ranges, noise, width
        )
        pick = np.r_[np.arange(shared), np.arange(start, start + own_size[number])]
        matrix[np.ix_(pick, pick)] += g
        right[pick] += r
        square += s
        readings += n
        start += own_size[number]
    return Gram(
        blocks=tuple(blocks), matrix=matrix, right=right, square=square, readings=readings
    )


def _own_size(component: Component, patches: Sequence[Patch]) -> int:
    if component.relaxed.each == "profile":
        return sum(p.shape[0] for p in patches)
    from diagnosis.components.smooth import smooth_columns

    return len(smooth_columns([np.zeros((1, 1))] * 2, [(-1.0, 1.0)] * 2))


def scaled(gram: Gram, like: Gram | None = None) -> Gram:
    """Scale each component so that unit coefficients have a whitened rms of 1 over the readings.

    A component that is spanned by a law's grid is first turned into its main directions.

    Parameters
    ----------
    like : equations whose scales and turns are taken for components that recordings share
    """
    energy: dict[str, float] = {}
    for b in gram.blocks:
        own = float(np.trace(gram.matrix[b.columns, b.columns]))
        energy[b.component.name] = energy.get(b.component.name, 0.0) + own
    known = {} if like is None else {b.component.name: b.turn for b in like.blocks}
    blocks, at = [], 0
    for b in gram.blocks:
        name = b.component.name
        if like is not None and name not in known:
            continue
        if like is None and energy[name] <= IMITATED * gram.readings:
            continue
        if like is not None and b.recording is None:
            turn = known[name]
        else:
            turn = _turn(b, gram, energy[name])
        blocks.append(replace(b, turn=turn, columns=slice(at, at + turn.shape[1])))
        at += turn.shape[1]
    whole = np.zeros((len(gram.right), at))
    before = {(b.component.name, b.recording): b.columns for b in gram.blocks}
    for b in blocks:
        whole[before[b.component.name, b.recording], b.columns] = b.turn
    return replace(
        gram, blocks=tuple(blocks), matrix=whole.T @ gram.matrix @ whole, right=whole.T @ gram.right
    )


def _turn(block: Block, gram: Gram, energy: float) -> Floats:
    inner = gram.matrix[block.columns, block.columns]
    if not block.component.relaxed.spanned:
        return np.eye(len(inner)) * np.sqrt(gram.readings / max(energy, 1e-12))
    root = np.sqrt(np.diag(inner) + IMITATED)
    _, vectors = np.linalg.eigh(inner / np.outer(root, root))
    turn = (vectors / root[:, None])[:, ::-1][:, : SETTINGS.spanned]
    return np.asarray(turn * np.sqrt(gram.readings / np.trace(turn.T @ inner @ turn)))


def shared_only(baseline: Gram, found: Gram, settings: Settings) -> Equations:
    """Equations of baselines in the columns of the recordings, what is their own integrated.

    Their own columns have the smallest discrepancy of the grid.
    """
    own = np.concatenate([
        np.arange(b.columns.start, b.columns.stop)
        for b in baseline.blocks if b.recording is not None
    ] or [np.zeros(0, np.int64)])  # fmt: skip
    shared = {b.component.name: b for b in baseline.blocks if b.recording is None}
    matrix, right = np.zeros_like(found.matrix), np.zeros_like(found.right)
    pairs = [(b, shared[b.component.name]) for b in found.blocks if b.component.name in shared]
    g, r = baseline.matrix, baseline.right
    precision = g[np.ix_(own, own)] + np.eye(len(own)) / settings.mean_sizes()[0] ** 2
    here = np.concatenate([np.arange(b.columns.start, b.columns.stop) for b, _ in pairs])
    there = np.concatenate([np.arange(b.columns.start, b.columns.stop) for _, b in pairs])
    cross = g[np.ix_(own, there)]
    solved = np.linalg.solve(precision, np.column_stack([cross, r[own]]))
    matrix[np.ix_(here, here)] = g[np.ix_(there, there)] - cross.T @ solved[:, :-1]
    right[here] = r[there] - cross.T @ solved[:, -1]
    return Equations(matrix=matrix, right=right)


def _of_recording(members, patches, states, dense, columns, own, fields, ranges, noise, width):
    """Normal equations of one recording, its placement projected out of every reading."""
    profiles = sum(patches[k].shape[0] for k in members)
    parts, rows_at = [], 0
    for k in members:
        patch, state = patches[k], states[k]
        pick, weight = taken(patch, state)
        w = weight[pick]
        y = tamed(state.innovations, pick)[pick] * w
        made = [f for c in dense for f in fields[c.name][k]]
        for c in own:
            if c.relaxed.each != "profile":
                made += [f * state.sd_mm for f in mean_columns(c, patch, ranges, noise) or []]
        x = np.empty((y.size, len(made)))
        for j, f in enumerate(made):
            x[:, j] = state.whiten(np.broadcast_to(f, patch.shape))[pick] * w
        thin = [sparse.diags(w) @ _each_column(state, pick, patch.shape) for _ in columns]
        for c in own:
            if c.relaxed.each == "profile":
                factor = None
                if c.relaxed.times:
                    factor = np.nan_to_num(
                        np.broadcast_to(COVARIATES[c.relaxed.times].values(patch.view), patch.shape)
                    )
                e = sparse.diags(w) @ _each_profile(state, pick, patch.shape, factor)
                thin.append(_padded(e, rows_at, profiles))
        e = sparse.hstack(thin, format="csr") if thin else sparse.csr_matrix((y.size, 0))
        parts.append((state.columns[pick] * w[:, None], x, e, y))
        rows_at += patch.shape[0]
    pose, x, y = (np.concatenate([p[i] for p in parts]) for i in (0, 1, 3))
    e = sparse.vstack([p[2] for p in parts], format="csr")
    prior = np.eye(pose.shape[1]) + pose.T @ pose
    x = x - pose @ np.linalg.solve(prior, pose.T @ x)
    y = y - pose @ np.linalg.solve(prior, pose.T @ y)
    x = x.astype(np.float32)
    through = np.asarray(e.T @ pose)
    xx = (x.T @ x).astype(np.float64)
    xe = np.asarray(e.T @ x, dtype=np.float64).T
    ee = np.asarray((e.T @ e).todense()) - through @ np.linalg.solve(prior, through.T)
    whole = np.block([[xx, xe], [xe.T, ee]])
    right = np.concatenate([x.T @ y, np.asarray(e.T @ y)])
    order = _order(dense, columns, own, fields, width, profiles)
    return whole[np.ix_(order, order)], right[order], float(y @ y), y.size


def _order(dense, columns, own, fields, width, profiles):
    """Places of the columns as the blocks have them: shared dense, columns, then each own."""
    shared = sum(len(fields[c.name][0]) for c in dense)
    maps = [c for c in own if c.relaxed.each != "profile"]
    size = _own_size(maps[0], ()) if maps else 0
    thin_at = shared + size * len(maps)
    order = [np.arange(shared), thin_at + np.arange(width * len(columns))]
    next_map, next_thin = shared, thin_at + width * len(columns)
    for c in own:
        if c.relaxed.each == "profile":
            order.append(next_thin + np.arange(profiles))
            next_thin += profiles
        else:
            order.append(next_map + np.arange(size))
            next_map += size
    return np.concatenate(order)


def _each_profile(
    state: Whitened, pick: Mask, shape: tuple[int, int], factor: Floats | None
) -> sparse.csr_matrix:
    """Whitened indicator of each profile, in deviations of the noise, (readings, n)."""
    n, m = shape
    field = state.sd_mm if factor is None else factor * state.sd_mm
    number = np.broadcast_to(np.arange(n)[:, None], shape)[pick]
    entries = []
    for tooth in range(COMB):
        comb = np.where((np.arange(n) % COMB == tooth)[:, None], field, 0.0)
        value = state.whiten(comb)[pick]
        # the tooth at or before this profile that reaches it
        owner = number - (number - tooth) % COMB
        near = (owner >= 0) & (number - owner < REACH[0]) & (value != 0)
        where = np.flatnonzero(near)
        entries.append((value[where], where, owner[where]))
    return _assembled(entries, int(pick.sum()), n)


def _each_column(state: Whitened, pick: Mask, shape: tuple[int, int]) -> sparse.csr_matrix:
    """Whitened indicator of each column, in deviations of the noise, (readings, m)."""
    n, m = shape
    number = np.broadcast_to(np.arange(m)[None], shape)[pick]
    entries = []
    for tooth in range(COMB):
        comb = np.where((np.arange(m) % COMB == tooth)[None], state.sd_mm, 0.0)
        value = state.whiten(comb)[pick]
        # a reading is conditioned on columns three to the left and two to the right
        owner = number + 2 - (number + 2 - tooth) % COMB
        near = (owner >= 0) & (owner < m) & (value != 0)
        where = np.flatnonzero(near)
        entries.append((value[where], where, owner[where]))
    return _assembled(entries, int(pick.sum()), m)


def _assembled(entries, rows: int, columns: int) -> sparse.csr_matrix:
    value, where, owner = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.csr_matrix((value, (where, owner)), shape=(rows, columns))


def _padded(e: sparse.csr_matrix, before: int, total: int) -> sparse.csr_matrix:
    left = sparse.csr_matrix((e.shape[0], before))
    right = sparse.csr_matrix((e.shape[0], total - before - e.shape[1]))
    return sparse.hstack([left, e, right], format="csr")
