"""Which cases the proof's page tells."""

import pytest

from challenge.proof.choice import ALARM, FORCED, FOUND, pick_stories


def case(kind, *reported, top_1=1.0, precision=1.0, recall=1.0, alarm=True, **other):
    """Return a judged case, medium and concealed where nothing else is given."""
    return {
        "secret": {"kind": kind, "strength": other.get("strength", 1)},
        "facts": {"concealed": other.get("concealed", True), "oracle_gain": other.get("gain", 0.1)},
        "score": {"top_1": top_1, "precision": precision, "recall": recall, "alarm": alarm,
                  "reported": list(reported)},
        "effects": [], "none_of_these": other.get("none", 0.0),
    }  # fmt: skip


def told(**cases):
    return pick_stories({"cases": cases})


def test_a_success_and_two_failures_of_different_kinds():
    found = told(
        small=case("one", "line_bow"),
        large=case("one", "line_bow", gain=0.5),
        seen=case("one", "line_bow", gain=0.9, concealed=False),
        quiet=case("null", alarm=False),
        loud=case("null", none=0.6),
        louder=case("null", none=0.9),
        strange=case("unknown", "motion_blur", top_1=float("nan")),
    )
    assert found == [(FOUND, "large"), (ALARM, "louder"), (FORCED, "strange")]


def test_three_kinds_of_failure_leave_the_third_out():
    found = told(
        loud=case("null"),
        wrong=case("one", "line_bow", top_1=0.0, precision=0.0, recall=0.0),
        strange=case("unknown", "motion_blur"),
    )
    assert [name for _, name in found] == ["loud", "wrong"]


@pytest.mark.parametrize(
    ("judged", "words"),
    [
        (case("one", "line_bow", top_1=0.0, precision=0.0, recall=0.0), "a wrong name"),
        (case("one", top_1=0.0, precision=float("nan"), recall=0.0), "no name"),
        (case("two", "line_bow", "motion_blur", precision=0.5), "beside the right one"),
        (case("two", "line_bow", recall=0.5), "one of two"),
    ],
)
def test_the_title_states_what_is_wrong(judged, words):
    ((title, _),) = told(a=judged)
    assert title.startswith("A failure: ")
    assert words in title


def test_a_strong_fault_misnamed_comes_before_a_weak_one_not_seen():
    weak = case("one", top_1=0.0, precision=float("nan"), recall=0.0, strength=0)
    strong = case("two", "line_bow", recall=0.5, strength=2)
    assert [name for _, name in told(weak=weak, strong=strong)] == ["strong"]


def test_a_run_without_failures_and_successes_has_no_story():
    assert told(quiet=case("null", alarm=False), admitted=case("unknown")) == []
