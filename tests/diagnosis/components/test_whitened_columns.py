"""Whitened columns: what the whitener makes of each field, sparse ones like dense ones."""

import numpy as np
import pytest

from diagnosis.components.component import components_of, mean_columns
from diagnosis.components.covariate_ranges import ranges_of
from diagnosis.components.whitened_columns import Layout, column_groups, columns_on
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS
from tests.support.effect_case import bench_workspace

MEAN = {c.name: c for c in components_of("mean")}


@pytest.fixture(scope="module")
def ws() -> Workspace:
    ws = bench_workspace("domes")
    return Workspace.build(ws.patches[:1], ws.noise)


def test_columns_are_whitened_as_readings_are(ws: Workspace) -> None:
    patch, (state,) = ws.patches[0], ws.states(ws.predict(Model()))
    n, m = patch.shape
    ranges = ranges_of([patch], ("x",))
    bow = mean_columns(MEAN["line_bow"], patch, ranges) or ()
    layout = Layout(
        shared=((MEAN["line_bow"], len(bow)), (MEAN["column_offset"], m)),
        own=((MEAN["stage_vibration"], n),),
    )
    assert layout.size == len(bow) + m + n
    made = columns_on(patch, state, layout, ranges, ws.noise, 0)
    for field, column in zip(bow, made.dense, strict=True):
        expected = state.whiten(np.broadcast_to(field, (n, m)))[state.used]
        assert column == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
    thin = made.thin.toarray()
    assert made.at_thin.tolist() == list(range(len(bow), layout.size))
    one = state.whiten(np.where(np.arange(m)[None] == 7, state.sd_mm, 0.0))[state.used]
    assert thin[:, 7] == pytest.approx(one)
    late = state.whiten(np.where(np.arange(n)[:, None] == 5, state.sd_mm, 0.0))[state.used]
    assert thin[:, m + 5] == pytest.approx(late)
    # all columns together are one offset of all readings, and so are all profiles
    assert thin[:, :m].sum(axis=1) == pytest.approx(thin[:, m:].sum(axis=1))


def test_components_follow_each_other_in_their_layout() -> None:
    layout = Layout(shared=((MEAN["line_bow"], 3), (MEAN["column_offset"], 5)),
                    own=((MEAN["stage_vibration"], 4),))  # fmt: skip
    places = [at.tolist() for _, at in layout.places()]
    assert places == [[0, 1, 2], [3, 4, 5, 6, 7], [8, 9, 10, 11]]
    assert (layout.shared_size, layout.size) == (8, 12)


@pytest.mark.parametrize("points", [1, 100, SETTINGS.most_columns, 4096, 5001])
def test_groups_of_columns_are_neighbours_and_no_more_than_the_most(points: int) -> None:
    groups = column_groups(points)
    assert groups.size == points
    assert set(np.diff(groups)) <= {0, 1}
    assert groups[-1] + 1 <= SETTINGS.most_columns
    sizes = np.bincount(groups)
    assert len(set(sizes[:-1])) <= 1
