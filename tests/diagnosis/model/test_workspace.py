"""Workspaces: blocks of several correlation lengths, levels of the noise, parts of the profiles."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from sensors.effects.incidence_noise import IncidenceNoise
from sensors.effects.line_bow import LineBow
from sensors.effects.stage_vibration import StageVibration
from tests.support.effect_case import bench_workspace, taken_with

WAVE = StageVibration(amplitude_um=8.0, frequency_hz=7.0, phase_rad=0.3)


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("domes")


def test_blocks_hold_several_correlation_lengths(ws: Workspace) -> None:
    y, x = ws.noise.correlation_length_px()
    assert ws.block[0] >= 4 * y
    assert ws.block[1] >= 4 * x
    scores = ws.block_scores(ws.log_densities(Model()))
    assert scores.size >= 12 * len(ws.patches)


def test_the_level_is_refitted_where_an_effect_shapes_the_noise(ws: Workspace) -> None:
    model = Model(effects=(IncidenceNoise(exponent=1.0),))
    predictions = ws.predict(model)
    wider = replace(ws, patches=tuple(
        replace(p, depth_mm=q.mean_mm + 1.4 * (p.depth_mm - q.mean_mm))
        for p, q in zip(ws.patches, predictions, strict=True)
    ))  # fmt: skip
    assert wider.levelled(model).level == pytest.approx(1.4 * ws.levelled(model).level, rel=0.03)
    # no effect on the noise: the calibrated level is right as it is
    assert wider.levelled(Model(level=3.0)).level == 1.0


def test_a_thin_workspace_keeps_whole_profiles(ws: Workspace) -> None:
    total = ws.count([np.ones(p.shape, dtype=bool) for p in ws.patches])
    assert ws.thin(total) is ws
    large = replace(ws, patches=ws.patches * 40)  # more than a search looks at
    thin = large.thin(total * 10)
    assert sum(p.depth_mm.size for p in thin.patches) <= total * 10
    assert {p.depth_mm.shape[1] for p in thin.patches} == {ws.patches[0].depth_mm.shape[1]}

def test_a_gain_by_the_mean_leaves_the_noise_out() -> None:
    """All of a bow's, and none of what changes the noise alone."""
    bent = taken_with(bench_workspace("domes"), "domes", LineBow(sag_um=40.0))
    bow, louder = LineBow(sag_um=40.0), IncidenceNoise(exponent=1.0)
    whole = sum(
        (with_bow - plain)[mask].sum()
        for with_bow, plain, mask in zip(
            bent.log_densities(Model().with_effect(bow)), bent.log_densities(Model()),
            bent.masks_for(bow), strict=True,
        )
    )  # fmt: skip
    assert bent.gain_by_mean(Model(), bow, {}) == pytest.approx(whole, rel=1e-6)
    assert bent.gain_by_mean(Model(), louder, {}) == pytest.approx(0.0, abs=1e-6)
