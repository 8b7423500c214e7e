"""Offsets of columns are shrunk by their own scatter, well known or not."""

import numpy as np
import pytest

from diagnosis.columnwise import likely_variance


@pytest.mark.parametrize("true", [1e-6, 1e-4, 1e-2])
def test_the_variance_of_many_coefficients_is_found(true: float) -> None:
    rng = np.random.default_rng(2)
    weights = 10 ** rng.uniform(2, 7, 2000)  # inverse variances of the noise, very uneven
    turn = np.linalg.qr(rng.standard_normal((2000, 2000)))[0]
    gram = (turn * weights) @ turn.T
    offsets = np.sqrt(true) * rng.standard_normal(2000)
    noise = turn @ (np.sqrt(weights) * rng.standard_normal(2000))
    assert likely_variance(gram, gram @ offsets + noise) == pytest.approx(true, rel=0.2)


def test_nothing_is_nothing() -> None:
    rng = np.random.default_rng(3)
    gram = 1e6 * np.eye(400)
    assert likely_variance(gram, 1e3 * rng.standard_normal(400)) < 0.2e-6


def test_what_was_not_measured_has_a_finite_variance() -> None:
    assert np.isfinite(likely_variance(np.zeros((5, 5)), np.zeros(5)))
