"""Ranges of covariates hold nearly all readings; rare extremes leave waves for all others."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.components.covariate_ranges import ranges_of
from sensors.model import SensorModel
from sensors.view.covariates import COVARIATES
from sensors.view.view import View
from tests.support.small_parts import VIEWS, datasheet, part, poses


@pytest.fixture(scope="module")
def patch() -> Any:
    view = View(part("domes"), SensorModel(datasheet(60)), poses(30, **VIEWS[1]), np.arange(30.0))
    return SimpleNamespace(
        view=view, shape=view.shape, observed=view.in_range, edge=np.zeros(view.shape, dtype=bool)
    )


def test_ranges_hold_nearly_all_readings_and_no_rare_extreme(patch: Any) -> None:
    low, high = ranges_of([patch], ("incidence",))["incidence"]
    values = COVARIATES["incidence"].values(patch.view)[patch.observed]
    inside = (values >= low) & (values <= high)
    assert 0.96 < inside.mean() <= 1.0
    assert high <= values.max()
    assert ranges_of([patch], ("clock",)).keys() <= {"clock"}


def test_what_is_the_same_everywhere_has_no_range() -> None:
    """Level under the sensor: no function of the slope can be told from a constant."""
    view = View(part("plate"), SensorModel(datasheet(40)), poses(12), np.arange(12.0))
    level: Any = SimpleNamespace(
        view=view, shape=view.shape, observed=view.in_range, edge=np.zeros(view.shape, dtype=bool)
    )
    assert ranges_of([level], ("slope_y", "x")).keys() == {"x"}
