"""Causes: probabilities of components add up by effect; what is known already is no news."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.evidence.reported_causes import (
    Cause,
    Unexplained,
    not_yet_named,
    offered_beside,
    offered_in_turn,
    shares_by_effect,
)
from sensors.effects.relaxed import Relaxed

EFFECTS = {"bow, even": "line_bow", "bow, any": "line_bow", "form": "form_error", "other": ""}


def cause(name: str) -> Cause:
    return Cause(
        name=name, channel="mean", probability=0.9, alternatives=(), none_of_these=0.1, nats=50.0
    )


def test_components_of_an_effect_add_up() -> None:
    shares = {"bow, even": 0.5, "bow, any": 0.2, "form": 0.1, "other": 0.05, "": 0.15}
    named, rest = shares_by_effect(shares, EFFECTS)
    assert named == pytest.approx({"line_bow": 0.7, "form_error": 0.1})
    assert rest == pytest.approx(0.2)


@given(values=st.lists(st.floats(0, 1), min_size=5, max_size=5))
def test_no_probability_is_lost(values: list[float]) -> None:
    named, rest = shares_by_effect(dict(zip([*EFFECTS, ""], values, strict=True)), EFFECTS)
    assert sum(named.values()) + rest == pytest.approx(sum(values))


@given(values=st.lists(st.floats(0, 0.2), min_size=6, max_size=6))
def test_what_is_offered_is_more_probable_than_not(values: list[float]) -> None:
    """Where all names together are: with any share of the rest."""
    named = dict(zip("abcdef", values, strict=True))
    best = max(named, key=lambda n: named[n])
    others = dict(offered_beside(best, named))
    offered = named[best] + sum(others.values())
    assert offered > 0.5 or len(others) == 5
    # nobody who is left out is likelier than who is offered, or likely
    left = [p for n, p in named.items() if n != best and n not in others]
    assert max(left, default=0.0) <= min([0.05, *others.values()])


def test_a_sure_cause_has_no_alternatives() -> None:
    assert offered_beside("a", {"a": 0.9, "b": 0.04}) == ()
    assert offered_beside("a", {"a": 0.6, "b": 0.3, "c": 0.04}) == (("b", 0.3),)
    assert offered_beside("a", {"a": 0.45, "b": 0.04, "c": 0.03}) == (("b", 0.04), ("c", 0.03))


def test_an_alternative_is_as_probable_as_it_is_once_others_are_refuted() -> None:
    three = replace(
        cause("a"), probability=0.5, alternatives=(("b", 0.3), ("c", 0.15)), none_of_these=0.05
    )
    _, second, third = offered_in_turn(three)
    assert (second.name, second.probability, second.none_of_these) == ("b", 0.6, 0.1)
    assert second.alternatives == (("c", 0.3),)
    assert third.name == "c"
    assert third.probability == pytest.approx(0.75)
    assert third.none_of_these == pytest.approx(0.25)


def test_an_alternative_that_is_less_probable_than_none_is_not_offered_in_turn() -> None:
    two = replace(cause("a"), probability=0.9, alternatives=(("b", 0.04),), none_of_these=0.06)
    assert [c.name for c in offered_in_turn(two)] == ["a"]


def test_doubts_are_kept_one_after_the_other() -> None:
    assert cause("line_bow").doubted("One.").doubted("Two.").doubt == "One. Two."


def test_known_names_are_left_out() -> None:
    causes = [cause("line_bow"), cause("form_error")]
    assert [c.name for c in not_yet_named(causes, ["line_bow"])] == ["form_error"]
    assert not_yet_named(causes, []) == causes


@pytest.mark.parametrize(
    ("form", "of_surface"),
    [
        (Relaxed(channel="scale", along=("part_x", "part_y")), True),
        (Relaxed(channel="scale", along=("x", "depth")), False),
        (Relaxed(channel="scale", each="profile"), False),
    ],
)
def test_what_goes_with_time_or_the_line_is_no_surface(form: Relaxed, of_surface: bool) -> None:
    one = Unexplained(
        component="noise", channel="scale", probability=0.9, nats=9.0, size=0.1, relaxed=form
    )
    assert one.of_surface is of_surface
