"""Normal equations against dense algebra: whitened readings, combined columns, baselines."""

import numpy as np
import pytest

from diagnosis.components.component import components_of, mean_columns
from diagnosis.components.covariate_ranges import ranges_of
from diagnosis.evidence.gram import Block, Gram, grams_of, shared_only, turned, weights_of
from diagnosis.evidence.seen import seen
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.prepare import Prepared
from diagnosis.settings import SETTINGS


def test_normal_equations_are_those_of_whitened_readings(bowed: Prepared) -> None:
    ws = Workspace.build([p for p in bowed.patches if p.fit.any()][:1], bowed.noise)
    states = ws.states(ws.predict(Model()))
    names = ("line_bow", "column_offset", "stage_vibration")
    components = [c for c in components_of("mean") if c.effect in names]
    ranges = ranges_of(ws.patches, ("x",))
    _, whole = grams_of(components, ws.patches, states, ranges, bowed.noise)
    patch, state = ws.patches[0], states[0]
    n, m = patch.shape
    fields = []
    for b in whole.blocks:
        if b.component.relaxed.each == "column":
            fields += [np.where(np.arange(m)[None] == j, state.sd_mm, 0.0) for j in range(m)]
        elif b.component.relaxed.each == "profile":
            fields += [np.where(np.arange(n)[:, None] == i, state.sd_mm, 0.0) for i in range(n)]
        else:
            fields += mean_columns(b.component, patch, ranges) or []
    w = weights_of(patch, state)[state.used]
    x = np.stack([state.whiten(np.broadcast_to(f, (n, m)))[state.used] * w for f in fields], 1)
    lies, travels = np.split(state.columns[state.used], [6], axis=1)
    y = (state.innovations[state.used] + travels @ (patch.shift + state.moved)[6:]) * w
    pose = lies * w[:, None]
    kept = np.eye(len(y)) - pose @ np.linalg.solve(np.eye(6) + pose.T @ pose, pose.T)
    assert whole.matrix == pytest.approx(x.T @ kept @ x, abs=1e-6 * np.abs(whole.matrix).max())
    assert whole.right == pytest.approx(x.T @ kept @ y, abs=1e-6 * np.abs(whole.right).max())


def test_combined_equations_are_those_of_combined_columns(bowed: Prepared) -> None:
    rng = np.random.default_rng(2)
    now = seen([p for p in bowed.patches if p.fit.any()], bowed.noise, Model())
    turns: dict[str, np.ndarray] = {}
    for b in now.bulk.blocks[:4]:
        turns[b.component.name] = np.full(1, 2.0) if len(turns) % 2 else rng.normal(
            size=(b.columns.stop - b.columns.start, 2)
        )
    parts = [
        (b.columns, turns[b.component.name])
        for b in now.bulk.blocks if b.component.name in turns
    ]  # fmt: skip
    whole = np.zeros((len(now.bulk.right), 0))
    for which, turn in parts:
        wide = np.zeros((len(whole), which.stop - which.start))
        wide[which] = np.eye(which.stop - which.start)
        whole = np.hstack([whole, wide * turn[0] if turn.ndim == 1 else wide @ turn])
    found = turned(now.bulk, turns)
    assert found.matrix == pytest.approx(whole.T @ now.bulk.matrix @ whole)
    assert found.right == pytest.approx(whole.T @ now.bulk.right)


def test_a_reading_far_off_counts_as_the_clip_and_no_farther(bowed: Prepared) -> None:
    ws = Workspace.build(bowed.patches[:1], bowed.noise)
    (state,) = ws.states(ws.predict(Model()))
    weight = weights_of(ws.patches[0], state)
    assert not weight[~state.used].any()
    off = state.used & ~ws.patches[0].edge
    assert (weight[off] <= 1.0).all()
    # off edges few readings are clipped, and their neighbours' mean alone takes them beyond it
    assert (weight[off] < 1.0).mean() < 0.01
    assert np.abs(weight * state.innovations)[off].max() < SETTINGS.clip + 5.0


def test_what_is_each_baselines_own_is_integrated() -> None:
    """Equations in the shared columns are those of y ~ N(X b, I + Z Z' s²), b shared, Z own."""
    rng = np.random.default_rng(1)
    x, z = rng.standard_normal((80, 3)), rng.standard_normal((80, 4))
    y = x @ [0.3, -0.2, 0.1] + rng.standard_normal(80)
    shared, own = (c for c in components_of("mean") if c.effect in ("line_bow", "stage_vibration"))
    if shared.effect != "line_bow":
        shared, own = own, shared
    both = np.hstack([x, z])
    baseline = Gram(
        blocks=(
            Block(component=shared, recording=None, columns=slice(0, 3)),
            Block(component=own, recording=0, columns=slice(3, 7)),
        ),
        matrix=both.T @ both, right=both.T @ y, readings=80,
    )  # fmt: skip
    found = Gram(
        blocks=(Block(component=shared, recording=None, columns=slice(2, 5)),),
        matrix=np.zeros((5, 5)), right=np.zeros(5), readings=80,
    )  # fmt: skip
    left = shared_only(baseline, found)
    precision = np.linalg.inv(np.eye(80) + SETTINGS.least_mean_size**2 * z @ z.T)
    assert left.matrix[2:, 2:] == pytest.approx(x.T @ precision @ x)
    assert left.right[2:] == pytest.approx(x.T @ precision @ y)
    assert not left.matrix[:2].any()
    assert not left.right[:2].any()
