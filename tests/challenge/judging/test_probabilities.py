"""Figures of stated probabilities on answers whose figures are known."""

import math

import numpy as np
import pytest

from challenge.judging.probabilities import (
    calibration_error,
    error_by_chance,
    log_score,
    reliability,
    score_by_chance,
    stated,
)


def case(names, switches=("worn roller",)):
    effects = [{"name": n, "probability": p} for n, p in names]
    return {"secret": {"switches": list(switches)}, "effects": effects}


def test_names_and_alternatives_count_and_names_without_probability_do_not():
    answer = case([("travel_ripple", 0.7)])
    answer["effects"][0]["alternatives"] = [{"name": "line_bow", "probability": 0.2}]
    answer["effects"].append({"name": "form_error"})
    assert stated(answer) == [(0.7, True), (0.2, False)]


def test_a_fair_forecaster_has_no_calibration_error_and_a_boastful_one_its_boast():
    fair = [(0.8, k < 8) for k in range(10)]
    assert calibration_error(reliability(fair)) == pytest.approx(0.0)
    assert calibration_error(reliability([(0.95, False)] * 4)) == pytest.approx(0.95)
    assert math.isnan(calibration_error(reliability([])))


def test_the_log_score_of_a_coin_is_ln_2_and_certainty_is_finite():
    assert log_score([(0.5, True), (0.5, False)]) == pytest.approx(math.log(2))
    assert math.isfinite(log_score([(1.0, False)]))


def test_true_probabilities_of_few_names_are_off_by_chance():
    p = np.random.default_rng(1).uniform(0.05, 0.98, 24)
    draws = np.random.default_rng(2).uniform(size=(3000, 24)) < p
    drawn = [list(zip(p.tolist(), hit.tolist(), strict=True)) for hit in draws]
    errors = [calibration_error(reliability(one)) for one in drawn]
    assert error_by_chance(drawn[0]) == pytest.approx(np.mean(errors), abs=0.005)
    scores = [log_score(one) for one in drawn]
    assert score_by_chance(drawn[0]) == pytest.approx(np.mean(scores), abs=0.01)
    # of ever more names it goes to nothing
    assert error_by_chance(drawn[0] * 400) < 0.02
    assert math.isnan(error_by_chance([]))
    assert math.isnan(score_by_chance([]))
