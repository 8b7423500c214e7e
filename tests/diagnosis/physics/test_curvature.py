"""The log density about a fit: a quadratic whose maximum a step of Newton reaches."""

import numpy as np
import pytest

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.curvature import Number, numbers_of, quadratic
from files.errors import RecipeError
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.line_bow import LineBow
from sensors.effects.stage_vibration import StageVibration
from tests.support.effect_case import bench_workspace, taken_with

WAVE = StageVibration(amplitude_um=8.0, frequency_hz=7.0, phase_rad=0.3)


@pytest.fixture(scope="module")
def bent() -> Workspace:
    return taken_with(bench_workspace("domes"), "domes", LineBow(sag_um=20.0))


def total(ws: Workspace, model: Model) -> float:
    return float(ws.block_scores(ws.log_densities(ws.levelled(model))).sum())


def test_a_step_gains_what_the_quadratic_says(bent: Workspace) -> None:
    off = Model(effects=(LineBow(sag_um=14.0),))
    about = quadratic(bent, off)
    assert about is not None
    assert about.newton[0] == pytest.approx(6.0, abs=0.6)
    there = about.climbed(bent, off, bent.masks())
    gained = total(bent, there) - total(bent, off)
    # readings that count as spikes far from the maximum make it a little less than quadratic
    assert gained == pytest.approx(about.to_gain, rel=0.15)
    again = quadratic(bent, there)
    assert again is not None
    assert again.to_gain < 0.02 * about.to_gain


def test_nothing_better_is_no_move(bent: Workspace) -> None:
    model = Model()
    about = quadratic(bent, Model(effects=(LineBow(sag_um=20.0),)))
    assert quadratic(bent, model) is None  # no number to move
    assert about is not None
    assert np.linalg.eigvalsh(about.curvature).min() > 0


def test_numbers_are_those_that_readings_off_edges_determine() -> None:
    model = Model(
        effects=(LineBow(sag_um=1.0), FiniteSpot(line_sd_um=50.0), WAVE),
        own={1: {"stage_vibration": {"phase_rad": 2.0}}},
    )
    named = [(n.effect, n.name, n.recording) for n in numbers_of(model)]
    assert ("line_bow", "sag_um", None) in named
    assert ("stage_vibration", "phase_rad", 1) in named
    assert not any(effect == "finite_spot" for effect, _, _ in named)
    assert {n.effect for n in numbers_of(model, of="line_bow")} == {"line_bow"}


def test_a_phase_begins_anew_and_a_number_ends() -> None:
    phase = Number(effect="stage_vibration", name="phase_rad", recording=1)
    model = Model(effects=(WAVE,), own={1: {"stage_vibration": {"phase_rad": 6.0}}})
    assert phase.value(phase.moved(model, 1.0)) == pytest.approx(7.0 - 2 * np.pi)
    amplitude = Number(effect="stage_vibration", name="amplitude_um")
    with pytest.raises(RecipeError, match="amplitude_um: out of bounds"):
        amplitude.moved(model, -9.0)
