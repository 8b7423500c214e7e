"""Periods over the range: a ripple with the camera's rows is found at its period."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.components.row_periods import strongest_rows
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS
from sensors.view.camera import row_of_depth
from tests.support.effect_case import bench_workspace


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("domes")


@pytest.mark.parametrize("rows", [300.0, 700.0])
def test_the_strongest_ripple_comes_first(ws: Workspace, rows: float) -> None:
    patches = []
    for patch in ws.patches:
        where = row_of_depth(patch.view.depth_mm, patch.view.datasheet, 1.0)
        ripple = 0.006 * np.sin(2 * np.pi * rows * where)
        patches.append(replace(patch, depth_mm=patch.depth_mm + ripple))
    there = replace(ws, patches=tuple(patches))
    states = there.states(there.predict(Model()))
    found = strongest_rows(there.patches, states, there.masks(), 1)
    assert len(found) == 3  # a period and half a cycle to either side of it
    assert min(abs(f - rows) for f in found) < 1.5


def test_few_readings_have_no_period(ws: Workspace) -> None:
    states = ws.states(ws.predict(Model()))
    none = [np.zeros(p.shape, dtype=bool) for p in ws.patches]
    none[0].ravel()[: SETTINGS.components.period_readings // 2] = True
    assert strongest_rows(ws.patches, states, none, 3) == []
