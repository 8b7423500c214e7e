"""Fits of one effect: its numbers are found again, and what can't act is left out."""

import pytest

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.effect_fit import fit_effect
from sensors.effects.base import Effect
from sensors.effects.interreflection import Interreflection
from sensors.effects.line_bow import LineBow
from sensors.effects.travel_ripple import TravelRipple
from tests.support.effect_case import bench_workspace, taken_with

BOW = LineBow(sag_um=40.0)


def fitted(ws: Workspace, kind: type[Effect], start: Effect | None = None) -> Effect | None:
    predictions = ws.predict(Model())
    found = fit_effect(kind, ws, Model(), ws.states(predictions), start=start)
    return None if found is None else found.effect


@pytest.fixture(scope="module")
def bent() -> Workspace:
    return taken_with(bench_workspace("domes"), "domes", BOW)


def test_a_linear_coefficient_is_found(bent: Workspace) -> None:
    found = fitted(bent, LineBow)
    assert isinstance(found, LineBow)
    assert found.sag_um == pytest.approx(40.0, abs=2.0)


def test_the_period_of_a_ripple_is_found_from_the_grid() -> None:
    true = TravelRipple(amplitude_um=25.0, period_mm=6.0, phase_rad=0.4)
    found = fitted(taken_with(bench_workspace("domes"), "domes", true), TravelRipple)
    assert isinstance(found, TravelRipple)
    assert found.period_mm == pytest.approx(6.0, rel=0.01)
    assert found.amplitude_um == pytest.approx(25.0, rel=0.15)


def test_what_cannot_act_is_no_fit() -> None:
    """No wall faces another on a gentle part."""
    assert fitted(bench_workspace("domes"), Interreflection) is None
