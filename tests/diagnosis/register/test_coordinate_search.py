"""A search along one number after the other finds what a gradient can't: minima of steps."""

import numpy as np
import pytest

from diagnosis.fields import Field
from diagnosis.register.coordinate_search import step_by_step

REACHES = (1.0, 0.3, 0.1, 0.03, 0.01)


def test_the_minimum_of_a_cost_in_steps_is_found() -> None:
    """Readings on the wrong side of an edge: a count, flat almost everywhere."""
    goal = np.array([1.37, -0.62])

    def cost(steps: Field) -> float:
        return float(np.ceil(50 * np.abs(steps - goal)).sum())

    best, saved = step_by_step(cost, 2, REACHES)
    assert best == pytest.approx(goal, abs=0.03)
    assert saved == cost(np.zeros(2)) - cost(best)


def test_from_the_minimum_nothing_moves() -> None:
    best, saved = step_by_step(lambda steps: float(steps @ steps), 3, REACHES)
    assert not best.any()
    assert saved == 0.0


def test_what_costs_the_same_everywhere_stays() -> None:
    best, saved = step_by_step(lambda _: 1.0, 2, REACHES)
    assert not best.any()
    assert saved == 0.0
