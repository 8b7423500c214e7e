"""Components: columns that follow their covariate and nothing else, as many as counted."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.components.component import (
    cell_of,
    components_of,
    count_of,
    curve_columns,
    mean_columns,
    missing_columns,
    seen_by_cameras,
)
from diagnosis.components.covariate_ranges import ranges_of
from diagnosis.prepare import Prepared
from diagnosis.settings import SETTINGS
from sensors.effects import CATALOGUE
from sensors.model import SensorModel
from sensors.view.covariates import COVARIATES
from sensors.view.view import View
from tests.support.small_parts import VIEWS, datasheet, part, poses

CHANNELS = ("mean", "scale", "missing", "outliers")


def of(effect: str, channel: str = "mean") -> Any:
    return next(c for c in components_of(channel) if c.effect == effect)


@dataclass(frozen=True)
class Looked:
    """A patch of which only the view counts."""

    view: View


@pytest.fixture(scope="module")
def patch() -> Any:
    view = View(part("domes"), SensorModel(datasheet(60)), poses(30, **VIEWS[1]), np.arange(30.0))
    return SimpleNamespace(
        view=view, shape=view.shape, observed=view.in_range, edge=np.zeros(view.shape, dtype=bool)
    )


def test_columns_are_counted_without_being_made(bowed: Prepared) -> None:
    patch = bowed.patches[0]
    names = ("x", "depth", "travel", "slope_y", "incidence", "clock", "part_x", "part_y")
    ranges = ranges_of([patch], names)
    for c in components_of("mean"):
        if not c.relaxed.each:
            made = mean_columns(c, patch, ranges, bowed.noise)
            assert count_of(c, patch, ranges, bowed.noise) == len(made or ()), c.name


def test_every_relaxed_form_of_the_catalogue_is_a_component() -> None:
    for channel in CHANNELS:
        found = components_of(channel)
        assert len({c.name for c in found}) == len(found)
        forms = [(n, r) for n, k in CATALOGUE.items() for r in k.relaxed if r.channel == channel]
        assert [(c.effect, c.relaxed) for c in found if c.effect] == forms
        assert any(not c.effect for c in found)  # unknown physics has a place in each channel


def test_a_bow_is_an_even_function_of_the_place_on_the_line_alone(patch: Any) -> None:
    x = np.broadcast_to(COVARIATES["x"].values(patch.view), patch.shape)[patch.observed]
    columns = curve_columns(of("line_bow"), patch.view, {"x": (-25.0, 25.0)})
    assert columns
    even = np.vander((x / 25.0) ** 2, SETTINGS.order_1d // 2 + 1)
    for column in columns:
        value = np.broadcast_to(column, patch.shape)[patch.observed]
        left = value - even @ np.linalg.lstsq(even, value, rcond=None)[0]
        assert np.abs(left).max() < 1e-9


def test_what_follows_the_range_is_one_number_at_one_depth(patch: Any) -> None:
    ranges = ranges_of([patch], ("depth",))
    depth = patch.view.depth_mm
    order = np.argsort(depth[patch.observed])
    for column in curve_columns(of("range_scale"), patch.view, ranges) or ():
        value = np.broadcast_to(column, patch.shape)[patch.observed][order]
        # a polynomial of sixth order over sorted depths: neighbours in depth are neighbours in it
        assert np.abs(np.diff(value)).max() < 0.2 * np.ptp(value)


def test_cells_are_narrow_in_their_covariate(patch: Any) -> None:
    noise = of("incidence_noise", "scale")
    ranges = ranges_of([patch], ("incidence",))
    low, high = ranges["incidence"]
    owner, values = cell_of(noise, patch, ranges), COVARIATES["incidence"].values(patch.view)
    for cell in np.unique(owner[patch.observed])[1:-1]:
        assert np.ptp(values[(owner == cell) & patch.observed]) <= (high - low) / SETTINGS.cells


def test_shares_of_losses_lie_between_none_and_all(patch: Any) -> None:
    for component in components_of("missing"):
        if component.relaxed.spanned:
            for column in missing_columns(component, patch):
                assert 0.0 <= column.min() <= column.max() <= 1.0


def test_a_camera_that_is_not_stated_may_be_on_either_side() -> None:
    """What follows the half-vector is looked at from both sides then, else from its own alone."""
    sheet = datasheet(20)
    form = of("specular_dropout", "missing")
    stated = View(part("plate"), SensorModel(sheet), poses(4), np.arange(4.0))
    nowhere = replace(sheet, triangulation_angle_deg=None, camera_side=None)
    bare = View(part("plate"), SensorModel(nowhere), poses(4), np.arange(4.0))
    own: Any = [Looked(stated)]
    assert [p[0].view for p in seen_by_cameras(form, own)] == [stated]
    either: Any = [Looked(bare)]
    sides = [p[0].view.datasheet.camera_side for p in seen_by_cameras(form, either)]
    assert sides == ["+y", "-y"]
