"""Figures of stated probabilities on answers whose figures are known."""

import math

import pytest

from challenge.judging.probabilities import calibration_error, log_score, reliability, stated


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
