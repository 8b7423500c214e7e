"""Explanations: what is there is named and fitted; laws taken back keep their evidence."""

import pytest

from diagnosis.explanation import Explanation, fitted_part
from diagnosis.model.model import Model
from diagnosis.prepare import Prepared
from sensors.effects.line_bow import LineBow
from tests.support.explained import explained
from tests.support.prepared_parts import ready


def test_a_good_instrument_needs_no_cause() -> None:
    plain = ready([], 11)
    nothing = explained(plain)
    assert (nothing.causes, nothing.unexplained) == ((), ())
    assert nothing.model.is_nominal
    assert nothing.placed == plain.placed
    assert {p.recording for p in nothing.held} == {2}


def test_a_bow_is_named_and_its_law_fitted(found: Explanation) -> None:
    (cause,) = found.causes
    assert cause.name == "line_bow"
    assert cause.probability > 0.9
    (law,) = found.model.effects
    assert isinstance(law, LineBow)
    assert law.sag_um == pytest.approx(40.0, abs=2.0)
    assert found.unexplained == ()


def test_the_readings_are_as_probable_under_the_model_as_under_the_truth(
    bent: Prepared, found: Explanation
) -> None:
    true = Model(effects=(LineBow(sag_um=40.0),))
    at, there = (float(sum(d.sum() for d in found.ws.log_densities(m))) for m in
                 (found.model, true))  # fmt: skip
    # one number is fitted: half a nat is what it gains of noise
    assert -1.0 < at - there < 10.0
    nominal = fitted_part(bent.patches, bent.noise)
    assert at > 1000 + float(sum(d.sum() for d in nominal.log_densities(Model())))


def test_what_is_withheld_is_left_without_a_name(bent: Prepared) -> None:
    every = frozenset({"line_bow", "form_error", "lens_distortion", "column_offset"})
    nameless = explained(bent, withheld=every)
    assert not {c.name for c in nameless.causes} & every
    assert nameless.causes or nameless.unexplained


def test_what_a_line_does_at_edges_is_named_and_sharp_edges_need_no_law() -> None:
    blurred = ready([{"name": "finite_spot", "line_sd_um": 300.0}], 5, name="steps")
    (cause,) = explained(blurred).causes
    assert cause.name == "finite_spot"
    assert cause.component is not None
    assert cause.component.relaxed.spanned
    sharp = explained(ready([], 5, name="steps"))
    assert (sharp.causes, sharp.unexplained) == ((), ())


def test_a_second_cause_is_held_against_the_baselines_too() -> None:
    """A bow that a good instrument could have, and this one's baselines have not."""
    shaken = {"name": "stage_vibration", "amplitude_um": 6.0, "frequency_hz": 40.0}
    one = ready([shaken, {"name": "line_bow", "sag_um": 1.5}], 7, baselines=True)
    assert {c.name for c in explained(one).causes} == {"stage_vibration", "line_bow"}
