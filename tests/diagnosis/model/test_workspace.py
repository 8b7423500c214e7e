"""Workspaces: blocks of several correlation lengths, levels of the noise, parts of the profiles."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.patch import Patch
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from sensors.effects.incidence_noise import IncidenceNoise
from sensors.effects.stage_vibration import StageVibration
from tests.support.effect_case import bench_workspace

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


def density(workspace: Workspace) -> float:
    """Log density under the nominal model, with noise and edges as they are."""
    found = zip(workspace.log_densities(Model()), workspace.masks(), strict=True)
    return float(sum(d[m].sum() for d, m in found))


def test_noise_at_edges_is_as_large_as_suits_and_no_merit_of_a_law() -> None:
    ws = bench_workspace("steps")
    rng = np.random.default_rng(3)
    rough = tuple(
        replace(p, depth_mm=p.depth_mm + p.edge * 3 * ws.noise.sd_mm * rng.standard_normal(p.shape))
        for p in ws.patches
    )
    rougher = replace(ws, patches=rough)

    assert rougher.most_probable(Model()) > density(rougher) + 100
    # as they are, they are better explained by no factor far from one
    assert ws.most_probable(Model()) >= density(ws)
    lost = density(ws) - density(rougher)
    assert ws.most_probable(Model()) - rougher.most_probable(Model()) < 0.8 * lost


def test_an_edge_s_place_is_as_unsure_as_suits() -> None:
    ws = bench_workspace("steps")
    rng = np.random.default_rng(5)

    # each reading's edge is elsewhere, four times as far as a pose may be off
    astray = tuple(
        replace(p, depth_mm=p.depth_mm + 4 * p.softness[0] * rng.standard_normal(p.shape))
        for p in ws.patches
    )
    moved = replace(ws, patches=astray)
    gained = moved.most_probable(Model()) - density(moved)
    alone = ws.most_probable(Model()) - density(ws)
    assert gained > alone + 100
    # more than any noise at all edges alike explains
    still = replace(moved, patches=tuple(replace(p, softness=_none(p)) for p in moved.patches))
    assert moved.most_probable(Model()) > still.most_probable(Model()) + 100


def _none(patch: Patch) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(patch.shape), patch.softness[1]
