"""Residual structure: what an unknown component follows, its size, its period, its place."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence.reported_causes import Unexplained
from diagnosis.localise.residual_structure import residual_structure
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from sensors.effects.relaxed import Relaxed
from sensors.view.camera import row_of_depth
from tests.support.effect_case import bench_workspace


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("domes")


def unexplained(nats: float = 90.0, **more: object) -> Unexplained:
    given = {"component": "c", "channel": "mean", "probability": 0.9, "size": 2.0, **more}
    return Unexplained(nats=nats, **given)


def test_sizes_have_the_unit_of_their_channel(ws: Workspace) -> None:
    mean, scale = residual_structure(
        [unexplained(), unexplained(40.0, channel="scale")], ws, Model()
    )
    assert mean.size == pytest.approx(2e3 * ws.noise.sd_mm)
    assert (mean.unit, scale.unit, scale.size) == ("µm", "1", 2.0)
    assert mean.as_json().keys() >= {"channel", "covariate", "frame", "size", "unit"}
    assert "period" not in mean.as_json()


def test_the_most_probable_comes_first_with_what_it_follows(ws: Workspace) -> None:
    found = residual_structure(
        [
            unexplained(10.0, relaxed=Relaxed(channel="mean", along=("x",))),
            unexplained(99.0, relaxed=Relaxed(channel="mean", each="column")),
            unexplained(50.0),
        ],
        ws, Model(),
    )  # fmt: skip
    assert [r.frame for r in found] == ["sensor", "time", "sensor"]
    assert [r.detail for r in found] == ["c, 99 nats", "c, 50 nats", "c, 10 nats"]


@pytest.mark.parametrize(
    ("effect", "words"),
    [("interreflection", "facing wall"), ("finite_spot", "curvature"), ("", "nearest depth edge")],
)
def test_light_at_edges_follows_what_its_law_does_and_not_the_time(
    effect: str, words: str, ws: Workspace
) -> None:
    """Each was called a mean over time."""
    relaxed = Relaxed(channel="mean", spanned=True)
    (found,) = residual_structure([unexplained(relaxed=relaxed, effect=effect)], ws, Model())
    assert words in found.covariate


def test_a_period_over_the_rows_is_a_length_of_depth(ws: Workspace) -> None:
    relaxed = Relaxed(channel="mean", along=("camera_row",), periodic=True, frequency="rows")
    (found,) = residual_structure([unexplained(repeats=300.0, relaxed=relaxed)], ws, Model())
    depths = np.concatenate([p.view.depth_mm[p.observed] for p in ws.patches])
    middle = np.quantile(depths, [0.25, 0.75])
    rows = row_of_depth(middle, ws.patches[0].view.datasheet, 300.0)
    assert found.period == pytest.approx(1e3 * np.ptp(middle) / abs(np.diff(rows)[0]), rel=0.05)
    assert found.period_unit == "µm"


def test_a_departure_is_marked_where_it_is(ws: Workspace) -> None:
    patch = ws.patches[0]
    bump = np.zeros(patch.shape)
    bump[20:28, 40:52] = 0.1
    there = replace(ws, patches=(replace(patch, depth_mm=patch.depth_mm + bump), *ws.patches[1:]))
    (found,) = residual_structure([unexplained()], there, Model())
    region = max(found.regions, key=lambda r: r.size_um)
    assert region.recording == patch.name
    for (first, end), (low, high) in ((region.profiles, (20, 28)), (region.points, (40, 52))):
        assert low - 4 <= first <= low + 2
        assert high - 2 <= end <= high + 4
    (still,) = residual_structure([unexplained()], ws, Model())
    # noise alone, averaged over neighbours, reaches a small part of it
    assert max(r.size_um for r in still.regions) < 0.2 * region.size_um
