"""POD curves against populations of known curve: estimates, and bounds that cover as claimed."""

import numpy as np
import pytest
from scipy.special import expit, logit, ndtr, ndtri
from scipy.stats import binom

from pipeline.pod.curve import DROP, NotEstimable
from pipeline.pod.hit_miss import HitMiss
from pipeline.pod.signal_response import SignalResponse

B0, B1 = 2.0, 3.0  # of ln a in mm
QUANTILE = {"logit": logit, "probit": ndtri}
INVERSE = {"logit": expit, "probit": ndtr}


def population(link, count, rng):
    size = np.exp(rng.uniform(np.log(0.1), np.log(3.0), count))
    return size, rng.uniform(size=count) < INVERSE[link](B0 + B1 * np.log(size))


def true_size(link, pod):
    return np.exp((QUANTILE[link](pod) - B0) / B1)


@pytest.mark.parametrize("link", ["logit", "probit"])
def test_hits_and_misses_give_back_the_curve(link):
    size, hit = population(link, 40_000, np.random.default_rng(1))
    curve = HitMiss.fit(size, hit, link)
    found = curve.estimate()
    assert found.a50 == pytest.approx(true_size(link, 0.5), rel=0.03)
    assert found.a90 == pytest.approx(true_size(link, 0.9), rel=0.03)
    assert found.a90 < found.a90_95 < 1.06 * found.a90
    # the score is zero at the maximum, in closed form for the logit
    if link == "logit":
        residual = hit - curve.pod(size)
        assert abs(residual.sum()) < 1e-3
        assert abs((residual * np.log(size)).sum()) < 1e-3


@pytest.mark.parametrize("link", ["logit", "probit"])
def test_the_bound_of_a90_covers_as_claimed(link):
    rng = np.random.default_rng(2)
    covered = 0
    for _ in range(200):
        curve = HitMiss.fit(*population(link, 150, rng), link)
        covered += curve.fall(true_size(link, 0.9), 0.9) <= DROP or (
            curve.size_at(0.9) >= true_size(link, 0.9)
        )
    low, high = binom.ppf([0.001, 0.999], 200, 0.95)
    assert low <= covered <= high


def test_the_bound_is_where_the_likelihood_has_fallen_so_far():
    size, hit = population("logit", 150, np.random.default_rng(5))
    curve = HitMiss.fit(size, hit)
    found = curve.estimate()
    assert curve.fall(found.a90, 0.9) == pytest.approx(0, abs=1e-6)
    assert curve.fall(found.a90_95, 0.9) == pytest.approx(DROP, abs=1e-3)
    lower = curve.lower_pod(found.a90_95)
    assert lower == pytest.approx(0.9, abs=1e-3)  # both bounds are of one likelihood


def responses(count, rng, sd=0.3):
    size = np.exp(rng.uniform(np.log(0.1), np.log(3.0), count))
    return size, np.exp(2.5 + 1.2 * np.log(size) + sd * rng.standard_normal(count))


def test_signal_response_gives_back_its_curve_from_censored_data():
    size, response = responses(20_000, np.random.default_rng(3))
    response[response < 2] = np.nan  # the recorder writes nothing below 2
    curve = SignalResponse.fit(size, response, threshold=5.0, floor=2.0)
    assert curve.intercept == pytest.approx(2.5, abs=0.02)
    assert curve.slope == pytest.approx(1.2, abs=0.02)
    assert curve.sd == pytest.approx(0.3, abs=0.01)
    expected = np.exp((np.log(5) + 1.2815515655 * 0.3 - 2.5) / 1.2)
    assert curve.estimate().a90 == pytest.approx(expected, rel=0.01)
    assert curve.pod(np.array(expected)) == pytest.approx(0.9, abs=0.01)


def test_the_bound_of_a_signals_a90_covers_as_claimed():
    rng = np.random.default_rng(4)
    truth = np.exp((np.log(5) + 1.2815515655 * 0.3 - 2.5) / 1.2)
    covered = 0
    for _ in range(200):
        curve = SignalResponse.fit(*responses(40, rng), threshold=5.0, floor=1.0)
        covered += curve.size_at(0.9) >= truth or curve.fall(truth, 0.9) <= DROP
    low, high = binom.ppf([0.001, 0.999], 200, 0.95)
    assert low <= covered <= high


def test_what_cannot_be_told_is_said():
    size = np.array([0.1, 0.2, 0.4, 0.8])
    with pytest.raises(NotEstimable, match="found"):
        HitMiss.fit(size, np.ones(4, bool))
    with pytest.raises(NotEstimable, match="no maximum"):
        HitMiss.fit(size, size > 0.3)
    with pytest.raises(NotEstimable, match="rise"):
        HitMiss.fit(np.tile(size, 5), np.tile(size < 0.3, 5) ^ (np.arange(20) == 0))
    with pytest.raises(NotEstimable, match="above the floor"):
        SignalResponse.fit(size, np.full(4, np.nan), threshold=5.0, floor=1.0)
