"""Shrinkage: a law that readings support counts whole, one they contradict doesn't."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.model.model import Model
from diagnosis.model.shrinkage import supported_shares
from diagnosis.model.workspace import Workspace
from diagnosis.predict.expectation import Shares, bending_effects, size_class
from diagnosis.settings import SETTINGS
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.travel_ripple import TravelRipple
from tests.support.effect_case import bench_workspace

CLASSES = len(SETTINGS.predict.size_classes)
WIDE = Model(effects=(FiniteSpot(line_sd_um=400.0),))


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("wedge")


def classes(ws: Workspace) -> np.ndarray:
    """Readings of each class at edges, under the wide spot."""
    count = np.zeros(CLASSES)
    for patch, plain, full in zip(ws.patches, ws.predict(Model()), ws.predict(WIDE), strict=True):
        change = np.abs(full.mean_mm - plain.mean_mm)[patch.edge & plain.seen] / ws.noise.sd_mm
        count += np.bincount(size_class(change), minlength=CLASSES)
    return count


def test_a_law_that_the_readings_deny_counts_little(ws: Workspace) -> None:
    known = classes(ws) > 60
    known[0] = False  # changes below half the noise say little
    assert known.sum() >= 2
    assert np.all(supported_shares(ws, WIDE).at_edges[known] < 0.35)


def test_a_law_that_they_bear_out_counts_whole(ws: Workspace) -> None:
    known = classes(ws) > 60
    known[0] = False
    both = zip(ws.patches, ws.predict(Model()), ws.predict(WIDE), strict=True)
    moved = tuple(
        replace(p, depth_mm=p.depth_mm + full.mean_mm - plain.mean_mm)
        for p, plain, full in both
    )
    assert np.all(supported_shares(replace(ws, patches=moved), WIDE).at_edges[known] > 0.85)


def test_without_a_model_or_a_reading_nothing_is_taken_off(ws: Workspace) -> None:
    found = supported_shares(ws, Model())
    assert np.array_equal([found.off_edges, found.at_edges], np.ones((2, CLASSES)))


def test_each_change_gets_the_share_of_its_class() -> None:
    at = np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.5])
    given = Shares(off_edges=at / 2, at_edges=at)
    change = np.array([0.0, -0.6, 1.0, -3.0, 5.0, 100.0, np.nan])
    assert np.array_equal(given.of(change, np.True_), [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 1.0])
    assert np.array_equal(given.of(change, np.False_), given.of(change, np.True_) / 2)


def test_what_moves_the_sensor_is_cast_and_not_weighed(ws: Workspace) -> None:
    moving = TravelRipple(amplitude_um=300.0, period_mm=5.0, phase_rad=0.3)
    assert bending_effects([moving, *WIDE.effects]) == list(WIDE.effects)
    found = supported_shares(ws, Model(effects=(moving,)))
    assert np.array_equal([found.off_edges, found.at_edges], np.ones((2, CLASSES)))
