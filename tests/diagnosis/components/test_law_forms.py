"""A component's columns, combined as its law combines them, draw the law."""

from collections.abc import Sequence

import numpy as np
import pytest

from diagnosis.components.component import Component, components_of, curve_columns
from diagnosis.components.covariate_ranges import ranges_of
from diagnosis.components.law_forms import law_forms
from diagnosis.components.smooth import products
from diagnosis.evidence.seen import COVARIATES
from diagnosis.model.workspace import Workspace
from sensors.effects import CATALOGUE
from tests.support.effect_case import bench_workspace

MEAN = {c.name: c for c in components_of("mean")}
OF_CURVES = ("line_bow", "range_scale", "lens_distortion", "lateral_error")


@pytest.fixture(scope="module")
def domes() -> Workspace:
    return bench_workspace("domes")


def forms(component: Component, ws: Workspace) -> tuple[np.ndarray, ...]:
    return law_forms(component, ws.patches, ranges_of(ws.patches, COVARIATES))


@pytest.mark.parametrize("name", OF_CURVES)
def test_it_draws_the_law_but_for_where_the_part_lay(name: str, domes: Workspace) -> None:
    (form,) = forms(MEAN[name], domes)
    ranges = ranges_of(domes.patches, COVARIATES)
    patch = domes.patches[0]
    basis = CATALOGUE[name].example().basis(patch.view)
    columns = curve_columns(MEAN[name], patch.view, ranges)
    assert basis is not None
    assert columns is not None
    assert form.shape == (len(columns), len(basis.fields))
    pick = patch.observed & ~patch.edge
    lies = patch.columns[pick]

    def beyond(fields: Sequence[np.ndarray]) -> np.ndarray:
        values = np.stack([np.broadcast_to(f, patch.shape)[pick] for f in fields], axis=1)
        return values - lies @ np.linalg.lstsq(lies, values, rcond=None)[0]

    law = beyond(basis.fields)
    left = law - beyond(columns) @ form
    # not drawn is a field that follows more than the component does, or that a placement imitates
    strong = law.std(axis=0) > 1e-3 * law.std(axis=0).max()
    assert np.min(left.std(axis=0)[strong] / law.std(axis=0)[strong]) < 0.1


def test_each_point_of_a_law_s_grid_is_a_form(domes: Workspace) -> None:
    drifts = forms(MEAN["thermal_drift"], domes)
    assert len(drifts) == len(CATALOGUE["thermal_drift"].example().grid(domes.patches[0].view))


@pytest.mark.parametrize("name", ["finite_spot", "column_offset", "map of the scan"])
def test_a_law_that_is_no_curve_has_none(name: str, domes: Workspace) -> None:
    assert forms(MEAN[name], domes) == ()


def test_a_part_bends_about_one_of_its_sides(domes: Workspace) -> None:
    """Of a series any few waves are as good; a bend of one curvature is a formula."""
    form = MEAN["form_error"]
    sides = forms(form, domes)
    ranges = ranges_of(domes.patches, COVARIATES)
    columns = curve_columns(form, domes.patches[0].view, ranges)
    assert columns is not None
    orders = products(2)
    first = len(columns) - len(orders)  # the constant that goes with what is raised
    assert len(sides) == 2
    for axis, side in enumerate(sides):
        (row,) = np.flatnonzero(side.any(axis=1))
        assert side.shape == (len(columns), 1)
        assert orders[row - first] == ((2, 0), (0, 2))[axis]
