"""A law's strength beside what good instruments have: closed form against least squares."""

import numpy as np
import pytest

from diagnosis.evidence.usual_share import moved_by


def test_a_departure_moves_a_strength_as_least_squares_do() -> None:
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((400, 5)) + 0.5 * rng.standard_normal((400, 1))
    law, other, size = np.array([0.8, -0.3]), np.array([2, 3, 4]), 0.2
    curve = columns[:, :2] @ law
    moved = [
        curve @ (columns[:, other] @ (size * rng.standard_normal(3))) / (curve @ curve)
        for _ in range(20_000)
    ]
    found = moved_by(columns.T @ columns, np.arange(2), law, [(other, size)])
    assert found == pytest.approx(np.std(moved), rel=0.02)


def test_a_departure_of_its_own_kind_moves_it_by_its_share() -> None:
    one = np.array([0])
    assert moved_by(np.array([[9.0]]), one, np.array([0.5]), [(one, 0.1)]) == pytest.approx(0.2)


def test_what_readings_tell_apart_moves_nothing() -> None:
    two = np.array([1])
    assert moved_by(np.diag([9.0, 4.0]), np.array([0]), np.array([0.5]), [(two, 3.0)]) == 0.0
    assert moved_by(np.zeros((2, 2)), np.array([0]), np.array([0.5]), [(two, 3.0)]) == 0.0
