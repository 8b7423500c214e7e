"""Shrinkage at edges: a law that readings support counts whole, one they contradict doesn't."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.model.edge_shrinkage import edge_shares
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.predict.expectation import EdgeShares, bending_effects, edge_class
from diagnosis.settings import SETTINGS
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.travel_ripple import TravelRipple
from tests.support.effect_case import bench_workspace

CLASSES = len(SETTINGS.predict.edge_classes)
WIDE = Model(effects=(FiniteSpot(line_sd_um=400.0),))


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("wedge")


def classes(ws: Workspace) -> np.ndarray:
    """Readings of each class at edges, under the wide spot."""
    count = np.zeros(CLASSES)
    for patch, plain, full in zip(ws.patches, ws.predict(Model()), ws.predict(WIDE), strict=True):
        change = np.abs(full.mean_mm - plain.mean_mm)[patch.edge & plain.seen] / ws.noise.sd_mm
        count += np.bincount(edge_class(change), minlength=CLASSES)
    return count


def test_a_law_that_the_readings_deny_counts_little(ws: Workspace) -> None:
    known = classes(ws) > 60
    known[0] = False  # changes below half the noise say little
    assert known.sum() >= 2
    assert np.all(edge_shares(ws, WIDE).shares[known] < 0.35)


def test_a_law_that_they_bear_out_counts_whole(ws: Workspace) -> None:
    known = classes(ws) > 60
    known[0] = False
    both = zip(ws.patches, ws.predict(Model()), ws.predict(WIDE), strict=True)
    moved = tuple(
        replace(p, depth_mm=p.depth_mm + full.mean_mm - plain.mean_mm)
        for p, plain, full in both
    )
    assert np.all(edge_shares(replace(ws, patches=moved), WIDE).shares[known] > 0.85)


def test_without_a_model_or_a_reading_nothing_is_taken_off(ws: Workspace) -> None:
    assert np.array_equal(edge_shares(ws, Model()).shares, np.ones(CLASSES))


def test_each_change_gets_the_share_of_its_class() -> None:
    given = EdgeShares(shares=np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.5]))
    change = np.array([0.0, -0.6, 1.0, -3.0, 5.0, 100.0, np.nan])
    assert np.array_equal(given.of(change), [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 1.0])


def test_what_moves_the_sensor_is_cast_and_not_weighed(ws: Workspace) -> None:
    moving = TravelRipple(amplitude_um=300.0, period_mm=5.0, phase_rad=0.3)
    assert bending_effects([moving, *WIDE.effects]) == list(WIDE.effects)
    assert np.array_equal(edge_shares(ws, Model(effects=(moving,))).shares, np.ones(CLASSES))
