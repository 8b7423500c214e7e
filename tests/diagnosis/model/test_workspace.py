"""Models and blocks: parameters of recordings stay with their effect; sums and levels."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.model.workspace import Model, Workspace, block_sums, bootstrap_interval
from sensors.effects.incidence_noise import IncidenceNoise
from sensors.effects.line_bow import LineBow
from sensors.effects.stage_vibration import StageVibration
from tests.support.effect_case import bench_workspace

WAVE = StageVibration(amplitude_um=8.0, frequency_hz=7.0, phase_rad=0.3)


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("domes")


def test_an_effect_takes_the_place_of_one_of_its_name() -> None:
    model = Model(effects=(LineBow(sag_um=1.0),)).with_effect(LineBow(sag_um=2.0))
    assert model.effects == (LineBow(sag_um=2.0),)
    both = model.with_effect(WAVE, {0: {"phase_rad": 1.0}, 1: {"phase_rad": 2.0}})
    assert both.names() == ("line_bow", "stage_vibration")
    phases = [both.of(r)[1].to_mapping()["phase_rad"] for r in (0, 1, 2)]
    assert phases == [1.0, 2.0, 0.3]
    assert both.without("stage_vibration").of(0) == model.effects
    assert both.with_effect(WAVE).of(1) == (*model.effects, WAVE)  # its own phases are gone


def test_sums_over_blocks_are_sums_over_the_grid() -> None:
    field = np.random.default_rng(1).standard_normal((23, 31))
    sums = block_sums(field, (5, 7)).reshape(5, 5)
    assert sums[1, 2] == pytest.approx(field[5:10, 14:21].sum())
    assert sums[4, 4] == pytest.approx(field[20:, 28:].sum())
    assert sums.sum() == pytest.approx(field.sum())


def test_the_interval_of_a_sum_is_the_normal_one_for_many_blocks() -> None:
    blocks = np.random.default_rng(2).normal(0.3, 2.0, 4000)
    low, high = bootstrap_interval(blocks, np.random.default_rng(0), draws=4000)
    half = 1.96 * blocks.std() * np.sqrt(blocks.size)
    assert (low + high) / 2 == pytest.approx(blocks.sum(), abs=0.1 * half)
    assert (high - low) / 2 == pytest.approx(half, rel=0.06)


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
