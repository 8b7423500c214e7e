"""The log density: a density it is, and placements are generalised least squares."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from diagnosis.model.log_density import STRAY, log_density, placed, placements, whitened
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.validate.heldout import largest_gap
from tests.support.effect_case import bench_workspace

STILL = np.zeros(9)


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("domes")


@pytest.mark.parametrize("outliers", [0.0, 0.05])
def test_the_density_of_a_reading_and_of_its_absence_is_one(ws: Workspace, outliers: float) -> None:
    """Integrated over the working range, a reading that has no neighbours."""
    patch, prediction = ws.patches[0], ws.predict(Model())[0]
    prediction = replace(
        prediction, p_missing=np.full(patch.shape, 0.2),
        p_outlier=np.full(patch.shape, max(outliers, 1e-12)),
        outlier_sd_mm=np.full(patch.shape, 0.5),
    )  # fmt: skip
    row, column = np.argwhere(prediction.seen & patch.observed)[2000]
    alone = np.full(patch.shape, np.nan)

    def density(depth_mm: float) -> float:
        depth = alone.copy()
        depth[row, column] = depth_mm
        values = log_density(replace(patch, depth_mm=depth), prediction, ws.noise, STILL)
        return float(np.exp(values[row, column]))

    mean, sd = prediction.mean_mm[row, column], prediction.sd_mm[row, column]
    steps = np.unique(np.concatenate([
        mean + sd * np.linspace(-8, 8, 161), mean + 0.5 * np.linspace(-6, 6, 121),
    ]))  # fmt: skip
    near = np.trapezoid([density(z) for z in steps], steps)
    missing = density(np.nan)
    assert missing == pytest.approx(0.2)
    assert near + missing == pytest.approx(1.0, abs=2e-3)
    sheet = patch.view.datasheet
    # far from its mean a reading comes from anywhere in the range
    anywhere = 0.8 * STRAY / sheet.z_range_mm
    assert density(mean + 10.0) == pytest.approx(anywhere, rel=0.01)


def test_a_placement_is_found_again(ws: Workspace) -> None:
    truth = {0: np.array([0.2, -0.1, 0.3, 0, 0, 0, 0, 0, 0.0]), 1: STILL}
    predictions = ws.predict(Model())
    patches = [
        replace(p, depth_mm=q.mean_mm + p.columns @ truth[p.recording])
        for p, q in zip(ws.patches, predictions, strict=True)
    ]
    states = [whitened(p, q, ws.noise) for p, q in zip(patches, predictions, strict=True)]
    found = placements(patches, states, ws.masks())
    for patch, state in zip(patches, states, strict=True):
        # the placement's prior is next to nothing beside thousands of readings
        shift = patch.columns @ (found[patch.recording] - truth[patch.recording])
        assert np.abs(shift[state.used]).max() < 0.05 * ws.noise.sd_mm
        rest = placed(patch, state, found[patch.recording])
        assert np.abs(rest.residual_mm).max() < 0.05 * ws.noise.sd_mm


def test_readings_far_off_move_no_placement(ws: Workspace) -> None:
    predictions = ws.predict(Model())
    states = ws.states(predictions)
    before = placements(ws.patches, states, ws.masks())
    spiked = []
    for state in states:
        innovations = state.innovations.copy()
        innovations[::10, ::10] = 40.0
        spiked.append(replace(state, innovations=innovations))
    after = placements(ws.patches, spiked, ws.masks())
    for recording, patch in enumerate(ws.patches):
        shift = patch.columns @ (after[recording] - before[recording])
        assert np.abs(shift).max() < 0.5 * ws.noise.sd_mm


def test_profiles_that_are_no_measurements_score_nothing(ws: Workspace) -> None:
    patch = replace(ws.patches[0], dropped=np.arange(len(ws.patches[0].depth_mm)) % 2 == 1)
    scores = log_density(patch, ws.predict(Model())[0], ws.noise, STILL)
    assert (scores[1::2] == 0).all()
    assert (scores[::2] != 0).all()


def test_the_gap_to_the_normal_is_kolmogorovs() -> None:
    values = np.random.default_rng(3).normal(0.1, 1.2, 400)
    assert largest_gap(values) == pytest.approx(float(kstest(values, "norm").statistic))
    assert np.isnan(largest_gap(np.zeros(0)))
