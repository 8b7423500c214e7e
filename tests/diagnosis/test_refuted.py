"""Laws that held-out readings refute: curves in their place, or components without a name."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from diagnosis.diagnose import judge_on_heldout
from diagnosis.explanation import Explanation
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.prepare import Prepared
from diagnosis.refuted import with_free_curves, without_names
from diagnosis.validate import found_effects
from diagnosis.validate.found_effects import heldout_gains
from diagnosis.validate.heldout import Judgement


def test_a_curve_in_place_of_a_law_explains_as_much_and_keeps_the_name(
    bent: Prepared, found: Explanation
) -> None:
    instead = with_free_curves(found, bent)
    assert instead.model.effects == ()
    assert {p.component.effect for p in instead.model.curve.parts} == {"line_bow"}
    assert [c.name for c in instead.causes] == ["line_bow"]
    assert "refuted" in instead.causes[0].doubt
    law, curve, nothing = (
        float(sum(d.sum() for d in ws.log_densities(model)))
        for ws, model in (
            (found.ws, found.model), (instead.ws, instead.model), (instead.ws, Model()),
        )
    )  # fmt: skip
    assert curve - nothing == pytest.approx(law - nothing, rel=0.02)


def test_laws_taken_back_leave_their_components_without_a_name(
    bent: Prepared, found: Explanation
) -> None:
    back = without_names(found, bent)
    assert back.causes == ()
    assert back.model.is_nominal
    assert back.placed is bent.placed
    (cause,), unexplained = found.causes, back.unexplained[0]
    assert (unexplained.nats, unexplained.size) == (cause.nats, cause.size)
    # an unknown component is the less likely before any reading
    assert 0.5 < unexplained.probability < cause.probability
    assert cause.component is not None
    assert unexplained.relaxed == cause.component.relaxed


def test_a_curve_that_readings_held_out_have_weighed_is_as_probable_as_they_said(
    bent: Prepared, found: Explanation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The likeliest curve alone may lead astray where it was not fitted."""

    def astray(ws: Workspace, model: Model, judged: Callable[[Model], Judgement]) -> object:
        gains, after = heldout_gains(ws, model, judged)
        return dict.fromkeys(gains, lost), after

    lost = -0.01
    monkeypatch.setattr(found_effects, "heldout_gains", astray)
    instead = with_free_curves(found, bent)
    (cause,) = instead.causes
    reported = []
    for on_all in (True, False):
        one = replace(instead, causes=(replace(cause, on_all=on_all),))
        judged = judge_on_heldout(bent, one, instead.model, bent.noise, [])
        reported.append(judged.found[0].probability)
    assert reported[0] == cause.probability
    assert reported[1] < 0.01
    # so improbable that a float is zero, and its rival as well
    lost = -10.0
    rivals = replace(cause, alternatives=(("range_scale", 0.1),))
    judged = judge_on_heldout(
        bent, replace(instead, causes=(rivals,)), instead.model, bent.noise, []
    )
    (effect,) = judged.found
    assert (effect.probability, effect.alternatives[0][2]) == (0.0, 0.0)
