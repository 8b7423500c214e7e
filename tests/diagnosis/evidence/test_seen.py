"""Recordings as equations: components of one size, and baselines in the same columns."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.patch import all_fitted
from diagnosis.evidence.seen import Seen, channels_seen, seen, together
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


def test_two_looks_together_are_one_at_all_recordings(bowed: Prepared, now: Seen) -> None:
    held = all_fitted([p for p in bowed.patches if not p.fit.any()])
    every = all_fitted(bowed.patches)
    assert {p.recording for p in held} < {p.recording for p in every}
    both = together([now, seen(held, bowed.noise, Model(), like=now)], every)
    at_once = seen(every, bowed.noise, Model(), like=now)
    for one, other in ((both.bulk, at_once.bulk), (both.whole, at_once.whole)):
        of_one, of_other = (
            [(b.component.name, b.recording, b.columns) for b in g.blocks] for g in (one, other)
        )
        assert of_one == of_other
        assert one.readings == other.readings
        size = np.abs(other.matrix).max()
        np.testing.assert_allclose(one.matrix, other.matrix, atol=1e-9 * size)
        np.testing.assert_allclose(one.right, other.right, atol=1e-9 * np.abs(other.right).max())
    assert [c.name for c in both.candidates] == [c.name for c in at_once.candidates]


def test_under_louder_noise_columns_stay_alike_and_readings_count_by_less(
    bowed: Prepared, now: Seen
) -> None:
    noise = replace(bowed.noise, long_waves=4.0)
    plain = seen([p for p in bowed.patches if p.fit.any()], noise, Model(), like=now.louder(4.0))
    louder = now.louder(4.0)
    for one, other in ((louder.bulk, plain.bulk), (louder.whole, plain.whole)):
        np.testing.assert_allclose(one.matrix, other.matrix, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(one.right, other.right, rtol=1e-9, atol=1e-9)
    assert louder.bulk.right == pytest.approx(now.bulk.right / 2)
