"""Intervals: the sandwich against its closed form, and how often they hold the truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.curvature import fitted_numbers
from diagnosis.physics.joint_fit import refit_linear
from diagnosis.physics.uncertainty import Estimate, intervals, refined, sandwich
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.line_bow import LineBow
from sensors.effects.stage_vibration import StageVibration
from tests.support.effect_case import bench_workspace


def test_the_sandwich_is_least_squares_covariance_where_noise_is_even() -> None:
    """s² (X'X)⁻¹ for independent errors, with A = X'X and scores X'e."""
    rng = np.random.default_rng(0)
    design = rng.normal(size=(40_000, 3)) @ np.array([[1, 0.5, 0], [0, 1, 0.2], [0, 0, 1]])
    error = rng.normal(0, 2.0, len(design))
    slopes = (design * error[:, None]).reshape(800, 50, 3).sum(axis=1).T
    found = sandwich(slopes, design.T @ design)
    known = 4.0 * np.linalg.inv(design.T @ design)
    sd = np.sqrt(np.diag(known))
    assert np.allclose(found / np.outer(sd, sd), known / np.outer(sd, sd), atol=0.15)


def test_the_sandwich_holds_where_errors_of_a_block_are_shared() -> None:
    """Fifty readings of one error are one reading: variance s²/n of n blocks."""
    error = np.repeat(np.random.default_rng(1).normal(0, 1.0, 600), 50)
    slopes = error.reshape(600, 50).sum(axis=1)[None]
    found = sandwich(slopes, np.array([[30_000.0]]))
    assert found[0, 0] == pytest.approx(1 / 600, rel=0.15)


def bent_by(sag_um: float) -> tuple[Workspace, Model]:
    """Recordings with a bow, and the model with the bow solved for."""
    ws, bow = bench_workspace("domes"), LineBow(sag_um=sag_um)
    bent = tuple(replace(p, depth_mm=p.depth_mm + bow.signature(p.view)) for p in ws.patches)
    ws = replace(ws, patches=bent)
    return ws, refit_linear(ws, Model(effects=(bow,)))


def test_a_bows_interval_is_that_of_generalised_least_squares() -> None:
    """Gaussian, linear: half a width is t times the deviation by least squares."""
    ws, model = bent_by(20.0)
    states = ws.states(ws.predict(model))
    field = [LineBow(sag_um=1.0).signature(p.view) for p in ws.patches]
    information = 0.0
    for number in sorted({p.recording for p in ws.patches}):
        own = [k for k, p in enumerate(ws.patches) if p.recording == number]
        columns, bent = (
            np.concatenate([v[k][states[k].used & ws.masks()[k]] for k in own])
            for v in (
                {k: states[k].columns for k in own},
                {k: states[k].whiten(field[k]) for k in own},
            )
        )
        normal = columns.T @ columns + np.eye(columns.shape[1])
        bent = bent - columns @ np.linalg.solve(normal, columns.T @ bent)
        information += float(bent @ bent)
    sag = intervals(ws, model, {})["line_bow"]["sag_um"]
    assert sag.low is not None
    assert sag.high is not None
    naive = 1.96 / np.sqrt(information)
    assert 0.5 * (sag.high - sag.low) == pytest.approx(naive, rel=0.35)


def test_a_frequency_is_known_the_less_for_phases_that_are_fitted() -> None:
    ws = bench_workspace("domes")
    wave = StageVibration(amplitude_um=8.0, frequency_hz=7.0, phase_rad=0.3)
    recordings = sorted({p.recording for p in ws.patches})
    phases = {r: {wave.name: {"phase_rad": 0.3}} for r in recordings}
    free, fixed = (
        intervals(ws, Model(effects=(wave,), own=own), {})[wave.name]["frequency_hz"]
        for own in (phases, {})
    )
    assert None not in (free.low, free.high, fixed.low, fixed.high)
    width = [e.high - e.low for e in (free, fixed)]  # type: ignore[operator]
    assert width[0] > 1.3 * width[1]


def test_what_has_no_interval_says_so_by_having_none() -> None:
    assert Estimate(value=2.0).as_json() == {"value": 2.0}
    assert Estimate(value=2.0, low=1.0, high=3.0).as_json() == {
        "value": 2.0, "low": 1.0, "high": 3.0,
    }  # fmt: skip
    assert fitted_numbers(LineBow(sag_um=1.0)) == ["sag_um"]
    assert stats.t.ppf(0.975, 1e6) == pytest.approx(1.96, abs=1e-3)


def test_newton_reaches_the_maximum_in_all_numbers_together() -> None:
    ws, model = bent_by(20.0)
    bow = model.effects[0]
    off = model.with_effect(bow.with_parameters(sag_um=bow.sag_um + 3.0))  # type: ignore[attr-defined]
    found = refined(ws, off)
    assert found.effects[0].sag_um == pytest.approx(bow.sag_um, abs=0.1)  # type: ignore[attr-defined]
    reached, before, true = (
        ws.block_scores(ws.log_densities(ws.levelled(m))).sum() for m in (found, off, model)
    )
    assert reached > before + 1
    assert reached >= true - 0.1


def test_what_lives_on_edges_has_no_interval() -> None:
    ws = bench_workspace("steps")
    found = intervals(ws, Model(effects=(FiniteSpot(line_sd_um=200.0),)), {})["finite_spot"]
    assert found["line_sd_um"] == Estimate(value=200.0)
