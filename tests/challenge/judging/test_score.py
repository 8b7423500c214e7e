"""Scores of plain answers, and intervals of shares against known values."""

import numpy as np
import pytest

from challenge.judging.score import clopper_pearson, judge_case
from tests.support.answers import answer


def test_clopper_pearson_against_known_values():
    # 0 of n: 1 - 0.025**(1/n)
    assert clopper_pearson(0, 60) == (0.0, pytest.approx(1 - 0.025 ** (1 / 60)))
    low, high = clopper_pearson(1, 60)  # Clopper & Pearson (1934): 0.04 % to 8.9 %
    assert low == pytest.approx(0.00042, abs=1e-5)
    assert high == pytest.approx(0.0894, abs=1e-4)


def _secret(kind, *switches):
    return {"kind": kind, "switches": list(switches), "strength": 1, "recordings": 3}


def test_scores_of_plain_answers():
    region = np.zeros((10, 10), bool)
    region[:5] = True
    args = ({"oracle_gain": 0.5}, answer("explained", "line_bow", "pose_error"), region, region)
    score = judge_case(_secret("one", "line_bow"), *args, 0.4)
    assert (score.top_1, score.recall, score.precision, score.iou) == (1, 1, 0.5, 1)
    assert score.recovered == pytest.approx(0.8)
    wrong = judge_case(_secret("one", "thermal_drift"), *args, 0.4)
    assert (wrong.top_1, wrong.recall, wrong.precision) == (0, 0, 0)
    beside = answer("explained", "form_error", alternatives=[{"name": "line_bow"}])
    half = judge_case(_secret("one", "line_bow"), {}, beside, None, None, 0.0)
    assert (half.top_1, half.recall, half.covered) == (0, 0.5, 1)
    both = judge_case(_secret("undecidable", "line_bow"), {}, beside, None, None, 0.0)
    assert both.covered == 1
    null = judge_case(_secret("null"), {}, answer("match"), None, None, 0.0)
    assert not null.alarm
    scattered = judge_case(_secret("one", "outlier_spikes"), *args, 0.4)
    assert np.isnan(scattered.iou)
    assert np.isnan(scattered.recovered)
    # a coarse camera locks with and without the effect: it leaves no place to compare with
    coarse = judge_case({**_secret("two", "line_bow"), "switches": ["line_bow", "pixel_locking"]},
                        *args, 0.4)  # fmt: skip
    assert np.isnan(coarse.iou)
    assert np.isnan(coarse.recovered)
    unknown = judge_case(_secret("unknown", "lost_counts"), {}, answer("unexplained"), None,
                         None, 0.0)  # fmt: skip
    assert unknown.flagged
    failed = judge_case(_secret("one", "line_bow"), {}, None, None, region, 0.0)
    assert (failed.top_1, failed.recall, failed.alarm, failed.iou) == (0, 0, False, 0)
