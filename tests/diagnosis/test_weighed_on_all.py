"""Of several causes the one that all readings need has the name; one that they deny has none."""

from dataclasses import replace

import pytest

from diagnosis.explanation import Explanation
from diagnosis.prepare import Prepared
from diagnosis.weighed_on_all import weighed_on_all
from tests.support.explained import explained
from tests.support.prepared_parts import ready


def test_held_out_readings_give_the_name_to_the_likelier_of_two(
    bent: Prepared, found: Explanation
) -> None:
    assert [c.name for c in found.causes] == ["line_bow"]
    sure, none = weighed_on_all(found, bent, frozenset())
    assert none == []
    assert [(c.name, c.alternatives) for c in sure.causes] == [("line_bow", ())]
    assert sure.model is found.model
    cause = replace(
        found.causes[0], name="form_error", probability=0.5, alternatives=(("line_bow", 0.4),)
    )
    undecided = replace(found, causes=(cause,), model=found.model.without("line_bow"))
    decided, _ = weighed_on_all(undecided, bent, frozenset())
    assert [c.name for c in decided.causes] == ["line_bow"]
    assert decided.model.names() == found.model.names()
    assert decided.causes[0].probability > 0.99


def test_a_name_that_was_not_offered_before_may_be_the_likelier(
    bent: Prepared, found: Explanation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was named with next to no probability, and an error followed."""
    (member,) = (m for m in found.members if m.candidate.effect == "line_bow")
    odds = {"line_bow": -900.0, "form_error": 5.0, "": -10.0}
    monkeypatch.setattr(
        "diagnosis.weighed_on_all.weighed_again", lambda *_, **__: [replace(member, odds=odds)]
    )
    decided, unlikely = weighed_on_all(found, bent, frozenset())
    assert unlikely == []
    assert [c.name for c in decided.causes] == ["form_error"]
    assert decided.causes[0].probability > 0.99


def test_no_two_causes_get_one_name(bent: Prepared, found: Explanation) -> None:
    (bow,) = found.causes
    other = replace(bow, name="form_error", probability=0.5, alternatives=(("line_bow", 0.4),))
    both, _ = weighed_on_all(replace(found, causes=(bow, other)), bent, frozenset())
    assert [c.name for c in both.causes] == ["line_bow", "form_error"]


def test_held_out_readings_speak_against_what_was_there_by_chance(found: Explanation) -> None:
    plain = ready([], 11)
    nothing = explained(plain)
    fooled = replace(
        nothing, causes=found.causes, members=found.members, model=found.model
    )
    left, unlikely = weighed_on_all(fooled, plain, frozenset())
    assert unlikely == ["line_bow"]
    assert left is fooled
