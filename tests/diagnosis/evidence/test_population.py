"""What is learnt of good instruments' discrepancy, and what baselines add."""

import numpy as np
import pytest

from diagnosis.evidence.assess import informed
from diagnosis.evidence.population import mixed, population
from diagnosis.settings import SETTINGS

SIZES = SETTINGS.mean_sizes()


def seen_as(size: float, k: int = 6, information: float = 4e4) -> np.ndarray:
    """Log factors of each size where the true coefficients are of one size."""
    pull = information * size * np.random.default_rng(round(1e6 * size)).standard_normal(k)
    v = SIZES**2 * information
    return np.array(
        [0.5 * (s**2 * pull @ pull / (1 + w)) - 0.5 * k * np.log1p(w)
         for s, w in zip(SIZES, v, strict=True)]
    )  # fmt: skip


def test_sizes_are_those_that_the_instruments_show() -> None:
    rng = np.random.default_rng(0)
    weights = mixed([seen_as(float(s)) for s in 0.03 * np.exp(0.5 * rng.standard_normal(40))])
    assert weights.sum() == pytest.approx(1.0)
    typical = SIZES[np.searchsorted(np.cumsum(weights), 0.5)]
    assert 0.015 < typical < 0.06
    assert weights[SIZES > 0.5].sum() < 1e-3


def test_good_instruments_without_a_departure_have_none() -> None:
    weights = mixed([seen_as(1e-5)] * 30)
    assert weights[SIZES > 0.05].sum() < 0.01


def test_a_baseline_narrows_what_an_instrument_may_have() -> None:
    before = {"bow": np.full(SIZES.size, 1 / SIZES.size)}
    after = informed(before, {"bow": seen_as(1e-5)})
    assert after["bow"].sum() == pytest.approx(1.0)
    assert after["bow"][SIZES > 0.1].sum() < 1e-3


def test_the_population_is_named_and_its_probabilities_add_up() -> None:
    found = population()
    assert "calibration" in found.name
    assert found.weights
    for name, weights in found.weights.items():
        grid = SETTINGS.rate_sizes() if ": " in name else SIZES
        assert weights.shape == grid.shape, name
        assert weights.sum() == pytest.approx(1.0, abs=1e-4), name
