"""Named distributions: their statistics against closed forms, and what a recipe may say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest, truncnorm

from quantity.distribution import Choice, Fixed, LogUniform, Normal, Uniform, parse_distribution

SPELLINGS = [
    (0.3, Fixed(value=0.3)),
    ({"uniform": [0.05, 0.4]}, Uniform(low=0.05, high=0.4)),
    ({"log_uniform": [0.01, 10]}, LogUniform(low=0.01, high=10.0)),
    ({"normal": [1.0, 0.5, 0.2, 1.5]}, Normal(mean=1.0, sd=0.5, low=0.2, high=1.5)),
    ({"choice": [1, 2, 4]}, Choice(values=(1.0, 2.0, 4.0))),
]


@pytest.mark.parametrize(("spelled", "size"), SPELLINGS)
def test_recipe_spelling_round_trip(spelled, size):
    assert parse_distribution(spelled) == size
    assert parse_distribution(size.to_recipe()) == size


@pytest.mark.parametrize(("spelled", "size"), SPELLINGS)
def test_same_seed_same_draws_within_limits(spelled, size):
    one, other = ([size.draw(np.random.default_rng(7)) for _ in range(3)] for _ in range(2))
    assert one == other
    low, high = size.limits()
    rng = np.random.default_rng(0)
    assert all(low <= size.draw(rng) <= high for _ in range(500))


@pytest.mark.parametrize(
    ("size", "cdf"),
    [
        (Uniform(low=2.0, high=3.0), lambda x: x - 2.0),
        (LogUniform(low=0.01, high=10.0), lambda x: np.log(x / 0.01) / np.log(1000.0)),
        (Normal(mean=1.0, sd=0.5, low=0.2, high=1.5), truncnorm(-1.6, 1.0, 1.0, 0.5).cdf),
    ],
)
def test_draws_follow_their_law(size, cdf):
    rng = np.random.default_rng(11)
    drawn = [size.draw(rng) for _ in range(4000)]
    assert kstest(drawn, cdf).pvalue > 1e-3


def test_choice_takes_each_value_as_often():
    rng = np.random.default_rng(2)
    drawn = [Choice(values=(1.0, 5.0, 9.0)).draw(rng) for _ in range(3000)]
    counts = np.unique(drawn, return_counts=True)[1]
    assert np.abs(counts - 1000).max() < 4 * np.sqrt(3000 * 2 / 9)


def test_normal_without_spread_is_its_mean():
    assert Normal(mean=0.4, sd=0.0, low=0.1, high=1.0).draw(np.random.default_rng(0)) == 0.4


@pytest.mark.parametrize(
    ("spelled", "says"),
    [
        ({"uniform": [0.4, 0.05]}, "low <= high"),
        ({"uniform": [0.4]}, r"must be \[low, high\]"),
        ({"uniform": 0.4}, "list of numbers"),
        ({"uniform": [0.1, "big"]}, "'big' must be a number"),
        ({"log_uniform": [0.0, 1.0]}, "above 0"),
        ({"normal": [5.0, 1.0, 0.0, 1.0]}, "must lie in"),
        ({"normal": [0.5, -1.0, 0.0, 1.0]}, "sd >= 0"),
        ({"choice": []}, "at least one"),
        ({"gamma": [1, 2]}, "uniform, log_uniform, normal, choice"),
        ({"uniform": [0, 1], "choice": [1]}, "must be a number or one of"),
        (True, "must be a number or one of"),
        (float("nan"), "finite"),
        ({"uniform": [0.0, float("inf")]}, "finite"),
        ("0.3", "must be a number or one of"),
    ],
)
def test_bad_spelling_gives_one_line(spelled, says):
    with pytest.raises(ValueError, match=says) as caught:
        parse_distribution(spelled)
    assert "\n" not in str(caught.value)


@given(
    st.floats(1e-3, 1e3), st.floats(0, 1e3), st.floats(0, 1e2), st.integers(0, 2**32)
)
def test_truncated_normal_stays_within_its_limits(mean, sd, width, seed):
    size = Normal(mean=mean, sd=sd, low=mean - width, high=mean + width / 3)
    assert size.low <= size.draw(np.random.default_rng(seed)) <= size.high
