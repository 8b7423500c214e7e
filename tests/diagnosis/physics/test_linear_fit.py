"""Robust least squares beside a placement."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.model.log_density import Whitened
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.physics.linear_fit import solve_linear
from sensors.effects.form_error import FormError, orders
from sensors.effects.line_bow import LineBow
from tests.support.effect_case import bench_workspace, taken_with


@pytest.fixture(scope="module")
def bowed() -> Workspace:
    """Two recordings of a wedge with a line bow of 10 µm."""
    return taken_with(bench_workspace("wedge"), "wedge", LineBow(sag_um=10.0))


def states_of(ws: Workspace) -> list[Whitened]:
    return list(ws.states(ws.predict(Model())))


def sag_and_gain(ws: Workspace, states: Sequence[Whitened]) -> tuple[float, float]:
    found = solve_linear(LineBow(), ws, states, ws.masks())
    assert found is not None
    assert isinstance(found.effect, LineBow)
    return found.effect.sag_um, found.gain


@pytest.mark.parametrize("spike", [10.0, 1000.0])
def test_readings_far_off_do_not_spoil_the_coefficient(bowed: Workspace, spike: float) -> None:
    """A tenth of the readings, where the field is largest, are outliers of one sign."""
    spiked = []
    for patch, state in zip(bowed.patches, states_of(bowed), strict=True):
        basis = LineBow().basis(patch.view)
        assert basis is not None
        white = state.whiten(np.broadcast_to(basis.fields[0], patch.shape))
        largest = white > np.quantile(white[state.used], 0.9)
        innovations = state.innovations + spike * (largest & state.used)
        spiked.append(replace(state, innovations=innovations))
    sag_um, gain = sag_and_gain(bowed, spiked)
    assert sag_um == pytest.approx(10.0, rel=0.02)
    assert gain > 500


def test_a_placement_that_is_not_the_best_yet_is_no_gain(bowed: Workspace) -> None:
    """Readings 5 standard deviations off by a displaced part alone."""

    def displaced(state: Whitened) -> Whitened:
        along = state.columns[..., 2]
        change = 5.0 * along / np.abs(along).max()
        return replace(state, innovations=state.innovations + change)

    nominal = bench_workspace("wedge")
    _, gain = sag_and_gain(nominal, [displaced(s) for s in states_of(nominal)])
    assert gain == pytest.approx(0.0, abs=0.1)
    right, wrong = states_of(bowed), [displaced(s) for s in states_of(bowed)]
    assert sag_and_gain(bowed, wrong) == pytest.approx(sag_and_gain(bowed, right), rel=0.01)


def test_a_form_has_the_waves_that_readings_bear() -> None:
    """2.5 periods over the part need more than the 14 waves that end at two."""
    sizes = {(2, 0): 60.0, (4, 0): 40.0, (5, 0): 40.0}
    true = FormError(coefficients_um=tuple(sizes.get(o, 0.0) for o in orders(20)))
    there = taken_with(bench_workspace("wedge"), "wedge", true)
    states = there.states(there.predict(Model()))
    few = FormError(coefficients_um=(0.0,) * 14)
    found, without = (
        fit_effect(FormError, there, Model(), states, start=start)
        for start in (None, few)
    )
    assert found is not None
    assert without is not None
    assert isinstance(found.effect, FormError)
    assert len(found.effect.coefficients_um) >= 20
    assert found.gain > without.gain + 500
