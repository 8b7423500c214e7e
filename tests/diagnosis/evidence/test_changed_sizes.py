"""Sizes that a change may have."""

import numpy as np
import pytest

from diagnosis.evidence.changed_sizes import changed, with_sizes_up_to


def test_a_change_is_larger_than_what_most_instruments_have() -> None:
    usual = np.array([0.1, 0.9, 0.0, 0.0, 0.0])
    weights = changed(usual)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[:2].max() < 1e-9
    assert np.all(np.diff(weights[2:]) < 0)


def test_what_passes_for_a_component_makes_its_sizes_usual() -> None:
    sizes, usual = np.array([1.0, 2.0, 4.0, 8.0]), np.array([1.0, 0.0, 0.0, 0.0])
    assert with_sizes_up_to(4.0, usual, sizes) == pytest.approx([4 / 6, 1 / 6, 1 / 6, 0.0])
    # less than the smallest size changes nothing
    assert np.array_equal(with_sizes_up_to(0.5, usual, sizes), usual)
