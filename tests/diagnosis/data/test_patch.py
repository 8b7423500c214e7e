"""Patches: whole profiles, spread over a recording, with their place in it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.data.patch import FEWEST_ROWS, WHOLE, in_range, spikes, strip_of, strips, thinned
from diagnosis.model.workspace import Workspace
from tests.support.effect_case import bench_workspace
from tests.support.small_parts import datasheet


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("domes")


@given(profiles=st.integers(1, 20_000), points=st.integers(1, 4_000))
def test_strips_are_apart_and_few(profiles: int, points: int) -> None:
    spans = strips(profiles, points)
    assert spans[0].start >= 0
    assert spans[-1].stop <= profiles
    assert all(a.stop <= b.start for a, b in zip(spans, spans[1:], strict=False))
    if len(spans) == 1:
        assert spans[0] == slice(0, profiles)
    else:
        assert sum(s.stop - s.start for s in spans) * points <= 2 * WHOLE
        assert (spans[0].start, spans[-1].stop) == (0, profiles)


def test_a_strip_keeps_its_place(ws: Workspace) -> None:
    patch = ws.patches[0]
    short = strip_of(strip_of(patch, slice(10, 40)), slice(5, 20))
    assert short.rows == slice(15, 30)
    assert np.array_equal(short.depth_mm, patch.depth_mm[15:30], equal_nan=True)
    assert np.array_equal(short.view.depth_mm, patch.view.depth_mm[15:30], equal_nan=True)
    assert np.allclose(short.view.travel_mm, patch.view.travel_mm[15:30], rtol=0, atol=1e-12)
    assert np.array_equal(short.softness[1], patch.softness[1][15:30])


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_thinned_patches_hold_so_many_readings(ws: Workspace, share: float) -> None:
    total = sum(p.depth_mm.size for p in ws.patches)
    short = thinned(ws.patches, int(share * total))
    assert sum(p.depth_mm.size for p in short) <= share * total
    assert sum(p.depth_mm.size for p in short) > 0.8 * share * total
    few = thinned(ws.patches, 1)
    assert [len(p.depth_mm) for p in few] == [FEWEST_ROWS] * len(ws.patches)


def test_a_spike_leaves_its_neighbours_and_a_step_does_not() -> None:
    residual = 0.001 * np.random.default_rng(1).standard_normal((30, 40))
    sd_mm = np.full(residual.shape, 0.001)
    used = np.ones(residual.shape, dtype=bool)
    residual[:, 20:] += 0.1  # smooth on either side: a misfit
    assert not spikes(residual, used, sd_mm).any()
    residual[7, 8] = 0.05
    assert np.argwhere(spikes(residual, used, sd_mm)).tolist() == [[7, 8]]
    used[7, 8] = False
    assert not spikes(residual, used, sd_mm).any()


def test_readings_out_of_the_range_are_missing() -> None:
    sheet = datasheet()
    ends = np.array([sheet.depth_min_mm, sheet.depth_max_mm])
    assert np.array_equal(in_range(ends, sheet), ends)
    assert np.isnan(in_range(ends + [-1e-6, 1e-6], sheet)).all()
