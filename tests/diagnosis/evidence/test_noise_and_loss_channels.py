"""Responses of the noise and of the losses: one a reading where the noise is as calibrated."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.components.covariate_ranges import ranges_of
from diagnosis.evidence.glm import Events, Squares
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_causes import RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel, channel_of
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS
from tests.support.effect_case import bench_workspace


@pytest.fixture(scope="module")
def ws() -> Workspace:
    ws = bench_workspace("domes")
    return Workspace.build(ws.patches[:1], ws.noise)


def channel(ws: Workspace, name: str) -> Channel:
    laws = ws.predict(Model())
    states = ws.states(laws)
    ranges = ranges_of(ws.patches, ("x", "depth", "travel", "incidence", "half_vector"))
    found = channel_of(name, ws.patches, laws, states, ranges, ws.noise)
    assert found is not None
    return found


def with_depth(ws: Workspace, depth_mm: Field) -> Workspace:
    return replace(ws, patches=(replace(ws.patches[0], depth_mm=depth_mm),))


def test_whitened_squares_are_one_where_the_noise_is_as_calibrated(ws: Workspace) -> None:
    found = channel(ws, "scale")
    assert found.responses.seen.mean() == pytest.approx(1.0, abs=0.1)
    assert isinstance(found.responses, Squares)
    assert (found.responses.number == 1).all()
    assert found.responses.information() == pytest.approx(
        2 * found.responses.seen.sum() / found.responses.dispersion
    )
    assert 1.0 <= found.responses.dispersion < 2.0
    assert not (found.picks[0] & ws.patches[0].edge).any()


def test_noise_twice_as_large_has_squares_four_times_as_large(ws: Workspace) -> None:
    patch = ws.patches[0]
    twice = with_depth(ws, patch.plain_mm + 2 * (patch.depth_mm - patch.plain_mm))
    before, after = (channel(w, "scale").responses.seen.mean() for w in (ws, twice))
    assert after / before == pytest.approx(4.0, rel=0.1)


def test_every_lost_reading_is_one_event(ws: Workspace) -> None:
    rng = np.random.default_rng(3)
    lost = rng.random(ws.patches[0].shape) < 0.03
    found = channel(with_depth(ws, np.where(lost, np.nan, ws.patches[0].depth_mm)), "missing")
    before = channel(ws, "missing")
    assert found.responses.seen.sum() >= before.responses.seen.sum()
    events = lost[found.picks[0]] | ~np.isfinite(ws.patches[0].depth_mm)[found.picks[0]]
    np.testing.assert_array_equal(found.responses.seen, events)
    # losses that come alone or in twos and threes count as nearly independent
    assert found.responses.dispersion < 1.6


def test_losses_in_clumps_count_as_clumps(ws: Workspace) -> None:
    """Nine readings under one grain of dust are one event, not nine."""
    depth = ws.patches[0].depth_mm.copy()
    for i in range(6, 66, 10):
        for j in range(10, 90, 13):
            depth[i : i + 3, j : j + 3] = np.nan
    assert 6.0 < channel(with_depth(ws, depth), "missing").responses.dispersion <= 9.0


def test_an_instrument_that_loses_less_than_most_departs_in_nothing(ws: Workspace) -> None:
    found = channel(ws, "outliers").responses
    assert isinstance(found, Events)
    assert (found.usual <= max(SETTINGS.noise.usual_share, found.usual.max())).all()
    # fewer are expected of all readings than one above those that came
    noise = SETTINGS.noise.usual_share * found.usual.size
    assert found.usual.sum() <= max(found.seen.sum() + 1.0, noise)


def test_columns_over_cells_have_a_rms_of_one(ws: Workspace) -> None:
    for candidate in channel(ws, "scale").candidates:
        if candidate.component.relaxed.each or not candidate.component.relaxed.along:
            continue
        for variant in candidate.variants:
            number = np.bincount(variant.owner, minlength=variant.count)[:, None]
            power = (number * np.square(variant.columns)).sum() / number.sum()
            assert power == pytest.approx(1.0, rel=0.3), candidate.name


def test_a_curve_of_losses_has_a_level_of_its_own(ws: Workspace) -> None:
    """What is lost at one end of a line is a share of none elsewhere, and not about a mean."""
    for name in ("missing", "outliers", "scale"):
        for candidate in channel(ws, name).candidates:
            relaxed = candidate.component.relaxed
            if relaxed.each or not relaxed.along:
                continue
            for variant in candidate.variants:
                off_edges = variant.columns[: variant.count // 2]
                level = (np.ptp(off_edges, axis=0) == 0).any()
                assert level == (name != "scale"), candidate.name


def test_each_channel_has_a_level_off_edges_and_at_them(ws: Workspace) -> None:
    for name in ("scale", "missing", "outliers"):
        found = channel(ws, name)
        off, edge_sd = 1.0, 1.0
        if isinstance(found.responses, Events):
            usual = np.sqrt(found.responses.usual).mean()
            off, edge_sd = SETTINGS.level_sd_off * usual, SETTINGS.level_sd_edge
        assert found.level_sd == pytest.approx(np.array([off, edge_sd]))
        for candidate in found.candidates:
            for variant in candidate.variants:
                half = variant.count // 2
                assert (variant.level[:half] == [1, 0]).all()
                assert (variant.level[half:] == [1, 1]).all()
                edge = np.concatenate(
                    [p.edge[k] for p, k in zip(ws.patches, found.picks, strict=True)]
                )
                np.testing.assert_array_equal(variant.owner >= half, edge)


def test_what_is_lost_at_edges_says_nothing_of_what_is_smooth() -> None:
    """Light of a steep side fails at its edges, and those lie together in columns and slopes."""
    steps = bench_workspace("steps")
    patch = steps.patches[0]
    one = Workspace.build([patch], steps.noise)
    right = np.arange(patch.shape[1]) > patch.shape[1] // 2
    at_edges = patch.edge & right & (np.random.default_rng(2).random(patch.shape) < 0.6)
    found = channel(with_depth(one, np.where(at_edges, np.nan, patch.depth_mm)), "missing")
    sound = channel(one, "missing")
    assert found.responses.seen.sum() > sound.responses.seen.sum() + 20
    search = RateSearch(found, Scales(sizes=SETTINGS.rate_sizes(), weights={}))
    for candidate in found.candidates:
        sized = search.sizes(found.responses, candidate)
        assert candidate.component.relaxed.spanned or not sized.stands_out, candidate.name


def test_what_an_edge_mixes_counts_as_no_outlier() -> None:
    """An edge along the travel has its mixed readings in one column, as no instrument has."""
    steps = bench_workspace("steps")
    one = Workspace.build(steps.patches[:1], steps.noise)
    patch = one.patches[0]
    mixed = np.where(patch.edge, patch.depth_mm + 1.0, patch.depth_mm)
    found = channel(with_depth(one, mixed), "outliers")
    assert patch.edge.any()
    assert not (found.picks[0] & patch.edge).any()
    assert found.responses.seen.sum() == channel(one, "outliers").responses.seen.sum()
