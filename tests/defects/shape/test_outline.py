"""Irregular outlines: their spread is the one asked for, and they close."""

import numpy as np
import pytest

from defects.shape.outline import outline

ANGLES = np.linspace(0, 2 * np.pi, 720, endpoint=False)


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.13])
def test_spread_about_one(spread):
    for seed in range(20):
        ratio = outline(ANGLES, spread, np.random.default_rng(seed))
        assert ratio.std() == pytest.approx(spread, abs=1e-9)
        assert ratio.mean() == pytest.approx(1.0, abs=1e-9)


def test_closes_smoothly_and_differs_between_draws():
    one, other = (outline(ANGLES, 0.1, np.random.default_rng(seed)) for seed in (0, 1))
    assert np.abs(np.diff(one, append=one[0])).max() < 0.01
    assert np.abs(one - other).max() > 0.05
    assert outline(ANGLES, 0.3, np.random.default_rng(3)).min() >= 0.5
