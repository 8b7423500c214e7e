"""The normal equations of all components: whitened once, then everything is linear algebra.

Readings are whitened under the calibrated noise; each recording's placement is projected out with
its prior. What is left of X'X and X'y is summed over recordings, off depth edges and over all
readings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from diagnosis.components.component import TRAVEL, Component, count_of
from diagnosis.components.smooth import Ranges
from diagnosis.components.whitened_columns import Columns, Layout, column_groups, columns_on
from diagnosis.data.patch import Patch
from diagnosis.evidence.posterior import Equations
from diagnosis.fields import Single
from diagnosis.model.log_density import Whitened
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
Turns = Mapping[str, Floats]
"""For each component's name, how its columns are combined."""
ROUNDED = 1e-9
"""Share of a column's energy below which what a placement leaves of it is rounding."""
AT_ONCE = 16_000
"""Readings whose products are summed at once: memory stays flat."""
NEAR = 5
"""Neighbours a side whose mean a reading may follow without being an outlier."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Block:
    """Columns of one component, of one recording's own where it has such."""

    component: Component
    recording: int | None
    columns: slice

    @property
    def at(self) -> NDArray[np.int64]:
        """Places of the columns."""
        return np.arange(self.columns.start, self.columns.stop)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Gram:
    """Normal equations beyond the placements.

    Attributes
    ----------
    blocks : whose each column is
    matrix, right : X'X and X'y
    readings : how many
    """

    blocks: tuple[Block, ...]
    matrix: Floats
    right: Floats
    readings: int

    @property
    def equations(self) -> Equations:
        """X'X and X'y alone."""
        return Equations(matrix=self.matrix, right=self.right)

    def louder(self, power: float) -> "Gram":
        """Let the noise have so much more power, and columns of a whitened rms of 1 with it."""
        return replace(self, right=self.right / np.sqrt(power))


def weights_of(patch: Patch, state: Whitened) -> Floats:
    """Weight (n, m) of each reading, by Huber's rule; 0 where it takes no part.

    A reading counts as far off its neighbours' mean as `clip` deviations at most, with what
    components would do to it (Huber, Robust Statistics, 1981, ch. 7). At depth edges readings
    scatter by more than the noise, since no edge is placed to a fraction of the spot: they count
    by as much less.
    """
    used = state.used
    share = np.maximum(uniform_filter(used.astype(float), NEAR, mode="constant"), 1e-9)
    middle = uniform_filter(np.where(used, state.innovations, 0.0), NEAR, mode="constant") / share
    middle = np.where((np.abs(middle) > 1.0) & ~patch.edge, middle, 0.0)
    off = np.abs(state.innovations - middle)
    weight = np.where(used, SETTINGS.clip / np.maximum(off, SETTINGS.clip), 0.0)
    at_edge = used & patch.edge
    if at_edge.any():
        loud = float(np.sqrt(np.square((weight * state.innovations)[at_edge]).mean()))
        weight[patch.edge] /= max(loud, 1.0)
    return weight


def grams_of(
    components: Sequence[Component],
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    ranges: Ranges,
    noise: NoiseModel,
) -> tuple[Gram, Gram]:
    """Sum the normal equations of all components over recordings.

    Where noise has more power in long waves than is modelled, readings count as by so many fewer.

    Returns
    -------
    of the readings off edges; of all readings
    """
    width = int(column_groups(patches[0].shape[1])[-1]) + 1
    shared = [(c, k) for c in components for k in [_shared(c, patches, ranges, noise)] if k]
    shared += [(c, width) for c in components if c.relaxed.each == "column"]
    blocks: list[Block] = []
    for component, k in shared:
        at = blocks[-1].columns.stop if blocks else 0
        blocks.append(Block(component=component, recording=None, columns=slice(at, at + k)))
    end = blocks[-1].columns.stop if blocks else 0
    shared_size, made_of = end, []
    for number in dict.fromkeys(p.recording for p in patches):
        ours = [k for k, p in enumerate(patches) if p.recording == number]
        own = _own(components, [patches[k] for k in ours], ranges, noise)
        layout = Layout(shared=tuple(shared), own=own)
        first = end
        for component, k in layout.own:
            blocks.append(
                Block(component=component, recording=number, columns=slice(end, end + k))
            )
            end += k
        made_of.append((ours, layout, np.r_[np.arange(shared_size), np.arange(first, end)]))
    totals = [(np.zeros((end, end)), np.zeros(end)) for _ in range(2)]
    counts = [0, 0]
    for ours, layout, places in made_of:
        for which, (g, r, count) in enumerate(
            _of_recording(ours, layout, patches, states, ranges, noise)
        ):
            totals[which][0][np.ix_(places, places)] += g
            totals[which][1][places] += r
            counts[which] += count
    louder = noise.long_waves
    bulk, whole = (
        Gram(blocks=tuple(blocks), matrix=g / louder, right=r / louder, readings=n)
        for (g, r), n in zip(totals, counts, strict=True)
    )
    return bulk, whole


def _shared(
    component: Component, patches: Sequence[Patch], ranges: Ranges, noise: NoiseModel
) -> int:
    """Count a component's columns that recordings share; 0 where it can't act on all of them."""
    if component.relaxed.each or component.own:
        return 0
    counts = {count_of(component, p, ranges, noise) for p in patches}
    return counts.pop() if len(counts) == 1 else 0


def _own(
    components: Sequence[Component], patches: Sequence[Patch], ranges: Ranges, noise: NoiseModel
) -> tuple[tuple[Component, int], ...]:
    """List the components of which each recording has its own, with their sizes."""
    profiles = sum(p.shape[0] for p in patches)
    return tuple(
        (c, profiles if c.relaxed.each else count_of(c, patches[0], ranges, noise))
        for c in components
        if c.own or c.relaxed.each == "profile"
    )


def _of_recording(
    ours: Sequence[int],
    layout: Layout,
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    ranges: Ranges,
    noise: NoiseModel,
) -> list[tuple[Floats, Floats, int]]:
    """Return the normal equations of one recording, off edges and over all readings."""
    sums: list[_Sums] = []
    before = 0
    for k in ours:
        patch, state = patches[k], states[k]
        columns = columns_on(patch, state, layout, ranges, noise, before)
        pick = state.used
        weight = weights_of(patch, state)[pick]
        lies, travels = np.split(state.columns[pick], [TRAVEL[0]], axis=1)
        # recordings as they are from the commanded travel, wherever they were registered
        values = state.innovations[pick] + travels @ (patch.shift + state.moved)[list(TRAVEL)]
        edge = patch.edge[pick]
        parts = [
            _Sums.of(columns, lies, values, weight, rows, layout.size)
            for rows in (np.flatnonzero(~edge), np.flatnonzero(edge))
        ]
        sums = [was.plus(more) for was, more in zip(sums, parts, strict=True)] if sums else parts
        before += patch.shape[0]
    bulk, at_edges = sums
    return [bulk.beyond_placement(), bulk.plus(at_edges).beyond_placement()]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Sums:
    """Products of placement (p), columns (x) and readings (y) with each other."""

    pp: Floats
    px: Floats
    py: Floats
    xx: Floats
    xy: Floats
    count: int

    @classmethod
    def of(
        cls,
        columns: Columns,
        pose: Single,
        values: Floats,
        weight: Floats,
        rows: NDArray[np.int64],
        size: int,
    ) -> "_Sums":
        w = weight[rows]
        p, y = pose[rows] * w[:, None], values[rows] * w
        thin = columns.thin[rows].multiply(w[:, None]).tocsr()
        d, t = columns.at_dense, columns.at_thin
        dense, between = np.zeros((d.size, d.size)), np.zeros((t.size, d.size))
        px, xy = np.zeros((p.shape[1], size)), np.zeros(size)
        for start in range(0, rows.size, AT_ONCE):
            some = slice(start, start + AT_ONCE)
            x = np.ascontiguousarray(columns.dense[:, rows[some]].T, dtype=np.float64)
            x *= w[some, None]
            dense += x.T @ x
            between += thin[some].T @ x
            px[:, d] += p[some].T @ x
            xy[d] += x.T @ y[some]
        px[:, t], xy[t] = np.asarray(thin.T @ p).T, np.asarray(thin.T @ y)
        xx = np.zeros((size, size))
        xx[np.ix_(d, d)], xx[np.ix_(t, t)] = dense, (thin.T @ thin).toarray()
        xx[np.ix_(t, d)], xx[np.ix_(d, t)] = between, between.T
        return cls(pp=p.T @ p, px=px, py=p.T @ y, xx=xx, xy=xy, count=rows.size)

    def plus(self, other: "_Sums") -> "_Sums":
        return _Sums(
            pp=self.pp + other.pp, px=self.px + other.px, py=self.py + other.py,
            xx=self.xx + other.xx, xy=self.xy + other.xy, count=self.count + other.count,
        )  # fmt: skip

    def beyond_placement(self) -> tuple[Floats, Floats, int]:
        """Project out the placement, whose numbers have a prior of unit variance.

        What is left of a column that the placement imitates is rounding, and becomes zero.
        """
        solved = np.linalg.solve(
            np.eye(len(self.pp)) + self.pp, np.column_stack([self.px, self.py])
        )
        left = self.xx - self.px.T @ solved[:, :-1]
        real = np.diag(left) > ROUNDED * np.diag(self.xx)
        return (
            left * real * real[:, None], (self.xy - self.px.T @ solved[:, -1]) * real, self.count
        )


def turns_of(bulk: Gram, whole: Gram) -> dict[str, Floats]:
    """Scale each component so that unit coefficients have a whitened rms of 1 over the readings.

    Off edges, for all but those that are spanned by a law's grid: these are turned into their main
    directions over all readings. What a placement imitates is left out.
    """
    out: dict[str, Floats] = {}
    for name in dict.fromkeys(b.component.name for b in bulk.blocks):
        own = [b for b in bulk.blocks if b.component.name == name]
        spanned = own[0].component.relaxed.spanned
        gram = whole if spanned else bulk
        energy = sum(float(np.trace(gram.matrix[b.columns, b.columns])) for b in own)
        if energy <= SETTINGS.imitated * gram.readings:
            continue
        if spanned:
            inner = gram.matrix[own[0].columns, own[0].columns]
            root = np.sqrt(np.diag(inner) + SETTINGS.imitated)
            _, vectors = np.linalg.eigh(inner / np.outer(root, root))
            turn = (vectors / root[:, None])[:, ::-1][:, : SETTINGS.spanned]
            out[name] = turn * np.sqrt(gram.readings / np.trace(turn.T @ inner @ turn))
        else:
            out[name] = np.full(1, np.sqrt(gram.readings / energy))
    return out


def turned(gram: Gram, turns: Turns) -> Gram:
    """Combine the columns of each component; leave out those without a turn."""
    blocks, weights, at = [], [], 0
    for b in gram.blocks:
        if b.component.name not in turns:
            continue
        turn = turns[b.component.name]
        weights.append((b.columns, turn))
        width = b.columns.stop - b.columns.start if turn.ndim == 1 else turn.shape[1]
        blocks.append(replace(b, columns=slice(at, at + width)))
        at += width
    half = _combined(gram.matrix, weights)
    return replace(
        gram, blocks=tuple(blocks), matrix=_combined(half.T, weights),
        right=_combined(gram.right, weights),
    )  # fmt: skip


def _combined(rows: Floats, weights: Sequence[tuple[slice, Floats]]) -> Floats:
    """Combine rows block by block: by one factor, or by a matrix."""
    parts = [
        turn[0] * rows[which] if turn.ndim == 1 else turn.T @ rows[which]
        for which, turn in weights
    ]
    return np.concatenate([rows[:0], *parts])


def joined(one: Gram, other: Gram) -> Gram:
    """Join the equations of recordings and of others, in the components that both have."""
    theirs = {b.component.name: b.at for b in other.blocks if b.recording is None}
    mine = [b for b in one.blocks if b.recording is not None or b.component.name in theirs]
    own = [b for b in other.blocks if b.recording is not None]
    ends = np.cumsum([b.at.size for b in (*mine, *own)])
    blocks = tuple(
        replace(b, columns=slice(int(end) - b.at.size, int(end)))
        for b, end in zip((*mine, *own), ends, strict=True)
    )
    of_one = [(b.at, was.at) for b, was in zip(blocks[: len(mine)], mine, strict=True)]
    of_other = [(b.at, theirs[b.component.name]) for b in blocks if b.recording is None]
    of_other += [(b.at, was.at) for b, was in zip(blocks[len(mine) :], own, strict=True)]
    matrix, right = np.zeros((ends[-1], ends[-1])), np.zeros(ends[-1])
    for gram, places in ((one, of_one), (other, of_other)):
        here, there = (np.concatenate(part) for part in zip(*places, strict=True))
        matrix[np.ix_(here, here)] += gram.matrix[np.ix_(there, there)]
        right[here] += gram.right[there]
    return Gram(blocks=blocks, matrix=matrix, right=right, readings=one.readings + other.readings)


def shared_only(baseline: Gram, found: Gram) -> Equations:
    """Equations of baselines in the columns of the recordings, what is their own integrated.

    Their own columns have the smallest discrepancy of the grid.
    """
    own = np.concatenate(
        [np.zeros(0, np.int64), *(b.at for b in baseline.blocks if b.recording is not None)]
    )
    theirs = {b.component.name: b.at for b in baseline.blocks if b.recording is None}
    pairs = [
        (b.at, theirs[b.component.name])
        for b in found.blocks
        if b.recording is None and b.component.name in theirs
    ]
    here, there = (np.concatenate(part) for part in zip(*pairs, strict=True))
    g, r = baseline.matrix, baseline.right
    precision = g[np.ix_(own, own)] + np.eye(len(own)) / SETTINGS.least_mean_size**2
    cross = g[np.ix_(own, there)]
    solved = np.linalg.solve(precision, np.column_stack([cross, r[own]]))
    matrix, right = np.zeros_like(found.matrix), np.zeros_like(found.right)
    matrix[np.ix_(here, here)] = g[np.ix_(there, there)] - cross.T @ solved[:, :-1]
    right[here] = r[there] - cross.T @ solved[:, -1]
    return Equations(matrix=matrix, right=right)
