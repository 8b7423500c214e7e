"""Curves beside laws: their fields, their place in a model, and a formula that no law has."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.components.component import Component, components_of, curve_columns
from diagnosis.components.free_curve import Curve, Part
from diagnosis.model.model import Model
from diagnosis.predict.prediction import law_of
from sensors.effects.line_bow import LineBow
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import VIEWS, datasheet, part, poses, record

BOW = next(c for c in components_of("mean") if c.effect == "line_bow")
OFFSETS = next(c for c in components_of("mean") if c.effect == "column_offset")


@pytest.fixture(scope="module")
def view() -> View:
    return View(part("steps"), SensorModel(datasheet(40)), poses(6), np.arange(6.0))


def bow(component: Component = BOW) -> Part:
    return Part(component=component, ranges=(("x", -20.0, 20.0),), coefficients=(0.01, -0.02, 0.03))


def test_a_curve_adds_its_columns_to_the_mean(view: View) -> None:
    columns = curve_columns(BOW, view, {"x": (-20.0, 20.0)})
    assert columns is not None
    by_hand = 0.01 * columns[0] - 0.02 * columns[1] + 0.03 * columns[2]
    plain, bent = (law_of(view, e, None).mean_mm for e in ((), (Curve(parts=(bow(),)),)))
    seen = np.isfinite(plain)
    assert (bent - plain)[seen] == pytest.approx(np.broadcast_to(by_hand, view.shape)[seen])


def test_values_of_columns_stay_with_their_columns(view: View) -> None:
    values = tuple(float(v) for v in np.arange(40.0))
    field = Part(component=OFFSETS, ranges=(), coefficients=values).field(view)
    assert np.broadcast_to(field, view.shape)[3] == pytest.approx(np.arange(40.0))


def test_a_cause_goes_with_its_curve_and_is_fitted_anew_beside_it() -> None:
    model = Model(effects=(LineBow(sag_um=5.0),), curve=Curve(parts=(bow(),)))
    assert len(model.of(0)) == 2
    assert model.without("line_bow").of(0) == ()
    assert model.without("range_scale").curve == model.curve
    assert model.refitting("line_bow").of(0) == (model.curve,)
    both = model.by_cause(0)
    assert list(both) == ["line_bow"]
    assert both["line_bow"] == model.of(0)
    assert list(replace(model, effects=()).by_cause(0)) == ["line_bow"]
    assert not replace(model, effects=()).is_nominal
    assert model.key != replace(model, curve=Curve()).key


def test_what_is_each_recordings_own_or_lives_at_edges_is_no_curve() -> None:
    named = {c.effect: c.is_curve for c in components_of("mean") if c.effect}
    assert named["line_bow"]
    assert named["column_offset"]
    assert not named["stage_vibration"]
    assert not named["reflectance_edge"]
    assert not any(c.is_curve for c in components_of("mean") if c.own)


def test_a_bow_of_another_formula_is_a_bow_and_leaves_nothing_behind() -> None:
    """A bow by the sixth power: its parabola leaves as much again, which is no other cause."""
    scene, sheet = part("domes"), datasheet(100)
    made = []
    for k, where in enumerate(VIEWS):
        scan = record(scene, sheet, [], name=f"r{k}", seed=40 + k, profiles=72, pitch_mm=0.6,
                      **where)  # fmt: skip
        u = View(scene, SensorModel(sheet), scan.poses, scan.time_s).off_axis_mm
        bend = 0.12 * (np.broadcast_to(u, scan.depth_mm.shape) / (sheet.x_fov_mm / 2)) ** 6
        made.append(replace(scan, depth_mm=scan.depth_mm + bend.astype(np.float32)))
    result = diagnosis_of(made, scene, sheet)
    assert [e.name for e in result.effects] == ["line_bow"]
    assert result.verdict == "explained"
    assert result.model.curve.parts
    assert "curve" in result.effects[0].doubt
    assert {e for m in result.maps for r in m.regions for e in [r.effect]} <= {"line_bow", ""}
    assert result.after.rms_um < 0.7 * result.before.rms_um
    assert result.after.rms_um == pytest.approx(1e3 * result.noise.sd_mm, rel=0.3)
