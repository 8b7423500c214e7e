"""Recordings as equations: components of one size, and baselines in the same columns."""

import numpy as np
import pytest

from diagnosis.evidence.seen import Seen, channels_seen, seen
from diagnosis.model.model import Model
from diagnosis.prepare import Prepared


@pytest.fixture(scope="module")
def now(bowed: Prepared) -> Seen:
    return seen([p for p in bowed.patches if p.fit.any()], bowed.noise, Model())


def test_components_have_a_whitened_rms_of_one(now: Seen) -> None:
    for component in now.components:
        gram = now.whole if component.relaxed.spanned else now.bulk
        at = [b.columns for b in gram.blocks if b.component.name == component.name]
        energy = sum(float(np.trace(gram.matrix[k, k])) for k in at)
        assert energy == pytest.approx(gram.readings, rel=1e-6), component.name


def test_equations_are_symmetric_and_nowhere_negative(now: Seen) -> None:
    for gram in (now.bulk, now.whole):
        size = np.abs(gram.matrix).max()
        np.testing.assert_allclose(gram.matrix, gram.matrix.T, atol=1e-9 * size)
        assert np.linalg.eigvalsh(gram.matrix).min() > -1e-6 * size
    assert now.bulk.readings <= now.whole.readings


def test_baselines_stand_in_the_same_columns(bowed: Prepared, now: Seen) -> None:
    before = seen(bowed.baseline, bowed.noise, Model(), like=now)
    assert before.turns is now.turns
    assert before.ranges is now.ranges
    shared = [
        [(b.component.name, b.columns.stop - b.columns.start) for b in g.blocks
         if b.recording is None]
        for g in (now.bulk, before.bulk)
    ]  # fmt: skip
    assert shared[0] == shared[1]


def test_channels_are_those_with_something_to_see(bowed: Prepared, now: Seen) -> None:
    channels = channels_seen(bowed.patches[:1], bowed.noise, Model(), now)
    assert [*channels] == ["scale", "missing", "outliers"]
