"""Average precision against closed forms; what counts as an alarm, a hit, a miss."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from challenge.payoff.gap import Outcome, outcome, pooled
from challenge.payoff.precision import (
    BINS,
    GROUPS,
    average_precision,
    share_closed,
    tally_flaws,
    tally_points,
)

DENT = ("dent", "large")


def histogram(bins):
    return np.bincount(np.asarray(bins, int), minlength=BINS).astype(float)


def test_perfect_ranking_has_precision_one():
    assert average_precision(histogram([5, 6]), histogram([1, 2, 3])) == 1.0


def test_worst_ranking_has_its_closed_form():
    # n positives below m negatives: mean of k / (m + k)
    n, m = 4, 10
    expected = np.mean([k / (m + k) for k in range(1, n + 1)])
    assert average_precision(histogram(range(n)), histogram(range(n, n + m))) == (
        pytest.approx(expected)
    )


def test_one_tie_of_all_is_the_share_of_positives():
    assert average_precision(histogram([7] * 3), histogram([7] * 9)) == pytest.approx(0.25)


def test_what_is_never_found_lowers_recall():
    assert average_precision(histogram([9]), histogram([1]), 3.0) == pytest.approx(0.25)


def test_no_positive_is_no_figure():
    assert np.isnan(average_precision(histogram([]), histogram([1, 2])))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_agrees_with_scikit_learn(seed):
    metrics = pytest.importorskip("sklearn.metrics")
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, 40, 200)
    truth = rng.random(200) < 0.2
    truth[0] = True
    ours = average_precision(histogram(bins[truth]), histogram(bins[~truth]))
    assert ours == pytest.approx(metrics.average_precision_score(truth, bins))


def test_points_that_count_neither_way_are_left_out():
    instance = np.array([[1, 0, -1]], np.int16)
    tally = tally_points(np.array([[0.9, 0.1, 0.99]]), instance, (DENT,))
    assert tally.hits.sum() == 1
    assert tally.false.sum() == 1
    assert tally.hits[GROUPS.index(DENT)].sum() == 1


def test_a_flaw_counts_by_its_highest_alarm_and_once():
    instance = np.zeros((60, 60), np.int16)
    instance[10:20, 10:30] = 1
    instance[40:50, 40:50] = 2
    score = np.full((60, 60), 1e-5)
    score[15, 12], score[15, 27] = 0.6, 0.9  # two alarms on the first flaw
    score[50, 5] = 0.8  # one on none; the second flaw has none
    tally = tally_flaws(score, instance, (DENT, ("pit", "small")))
    dents, pits = GROUPS.index(DENT), GROUPS.index(("pit", "small"))
    assert tally.hits[dents].sum() == 1
    assert tally.missed[pits] == 1
    assert tally.false.sum() == 1
    # the dent's alarm stands above the false one
    assert tally.hits[dents].argmax() > tally.false.argmax()


def test_share_closed_at_its_ends():
    assert share_closed(0.2, 0.2, 0.6) == 0
    assert share_closed(0.2, 0.6, 0.6) == 1
    assert share_closed(np.array(0.2), np.array(0.4), np.array(0.6)) == pytest.approx(0.5)


def tallies(levels, recordings=6, seeds=2):
    """Give hits of one bin each, above or below the false ones by the level of each set."""
    rng = np.random.default_rng(0)
    hits = np.zeros((len(levels), seeds, recordings, len(GROUPS), BINS), np.int32)
    false = np.zeros((len(levels), seeds, recordings, BINS), np.int32)
    for k, level in enumerate(levels):
        for r in range(recordings):
            good = rng.random(200) < level
            place = np.where(good, 1500, 100)
            hits[k, :, r] = np.bincount(place, minlength=BINS)
            false[k, :, r, 800] = 1000
    return {"hits": hits, "false": false, "missed": np.zeros(hits.shape[:-1], np.int32)}


def test_a_gap_of_nothing_has_no_share():
    same = tallies([0.5] * 5)
    for field in same.values():
        field[-1] = field[0]
    assert outcome(same, 1, draws=50).closed() is None


def test_the_share_lies_in_its_interval_and_pooling_keeps_it():
    one = outcome(tallies([0.2, 0.2, 0.3, 0.5, 0.6]), 1, draws=100)
    closed = one.closed()
    assert closed.low < closed.value < closed.high
    assert 0.6 < closed.value < 0.9
    assert one.gap().low > 0
    # of the sets between, each has its own share
    assert one.closed("noise").value < one.closed("diagnosed").value < closed.value
    twice = pooled([one, one])
    assert isinstance(twice, Outcome)
    assert twice.closed().value == pytest.approx(closed.value)


def test_the_bootstrap_is_the_seed_s():
    made = tallies([0.2, 0.2, 0.3, 0.5, 0.6])
    assert outcome(made, 3, draws=20).gap() == outcome(made, 3, draws=20).gap()
