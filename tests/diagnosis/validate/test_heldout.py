"""Judging: figures of readings whose law is known, and readings that serve one purpose only."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtri

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS
from diagnosis.validate.heldout import (
    judge,
    judging_masks,
    largest_gap,
    own_parts,
)
from sensors.effects.line_bow import LineBow
from tests.support.effect_case import bench_workspace, taken_with

BOW = LineBow(sag_um=40.0)


@pytest.fixture(scope="module")
def bent() -> Workspace:
    """Recordings with a bow, all readings for judging."""
    ws = taken_with(bench_workspace("domes"), "domes", BOW)
    return replace(ws, patches=tuple(replace(p, scored=p.fit) for p in ws.patches))


@given(profiles=st.integers(1, 400))
def test_readings_serve_one_purpose(profiles: int) -> None:
    mask = np.random.default_rng(profiles).random((profiles, 7)) < 0.8
    (small,), (scored,) = own_parts([mask])
    assert not (small & scored).any()
    assert ((small | scored) == mask).all()
    groups = SETTINGS.validate
    whole = profiles * groups.own_every * groups.group_profiles
    (every,), _ = own_parts([np.ones((whole, 1), dtype=bool)])
    assert every.mean() == pytest.approx(1 / groups.own_every)


def test_the_gap_of_known_samples() -> None:
    assert largest_gap(np.zeros(1)) == pytest.approx(0.5)
    n = 50
    assert largest_gap(ndtri((np.arange(n) + 0.5) / n)) == pytest.approx(0.5 / n)
    assert largest_gap(np.full(9, 40.0)) == pytest.approx(1.0)
    assert np.isnan(largest_gap(np.empty(0)))


def test_the_right_model_has_the_figures_of_its_law(bent: Workspace) -> None:
    right = judge(bent.patches, bent.noise, Model(effects=(BOW,)), share_own=False)
    assert right.rms_um == pytest.approx(1e3 * bent.noise.sd_mm, rel=0.03)
    assert right.coverage == pytest.approx((0.5, 0.9), abs=0.03)
    assert right.ks < 0.03
    wrong = judge(bent.patches, bent.noise, Model(), share_own=False)
    assert wrong.log_score > right.log_score + 0.1
    assert wrong.rms_um > 1.1 * right.rms_um
    assert right.counts.sum() == sum(p.scored.sum() for p in bent.patches)
    figures = right.as_json(np.random.default_rng(0))
    assert figures["log_score_low"] < figures["log_score"] < figures["log_score_high"]


def test_errors_in_and_beside_regions_are_told_apart(bent: Workspace) -> None:
    regions = [np.zeros(p.shape, dtype=bool) for p in bent.patches]
    moved = []
    for patch, region in zip(bent.patches, regions, strict=True):
        region[30:34, 40:44] = True
        moved.append(replace(patch, depth_mm=patch.depth_mm + 0.3 * region))
    found = judge(moved, bent.noise, Model(effects=(BOW,)), share_own=False, regions=regions)
    assert found.rms_in_um == pytest.approx(300.0, rel=0.1)
    assert found.rms_out_um == pytest.approx(1e3 * bent.noise.sd_mm, rel=0.05)


def test_what_serves_a_recordings_own_parameters_is_not_scored(bent: Workspace) -> None:
    small, scored = judging_masks(bent.patches, share_own=True)
    for one, other, patch in zip(small, scored, bent.patches, strict=True):
        assert one.any()
        assert not (one & other).any()
        assert ((one | other) == (patch.scored & patch.counted)).all()
