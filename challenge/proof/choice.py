"""Which cases the proof's page tells: one success that the usual checks miss, two failures."""

from collections.abc import Callable
from typing import Any

Scored = dict[str, Any]
Case = dict[str, Any]
FOUND = "Found: the paper's own checks see nothing here"
ALARM = "A failure: an instrument in good order, declared faulty"
FORCED = "A failure: a fault outside the catalogue, explained by names of the catalogue"


def pick_stories(scored: Scored) -> list[tuple[str, str]]:
    """Choose three cases by rule: title and name of each.

    The success is the concealed fault that moves readings most, named rightly and alone. Failures
    are of two kinds out of three, in this order: an alarm; a wrong or a missing name; a fault
    outside the catalogue that was given a name of the catalogue. Medium and strong faults come
    before weak ones.
    """
    cases = scored["cases"]
    success = _largest(
        cases,
        lambda c: c["secret"]["kind"] == "one" and bool(c["facts"].get("concealed"))
        and c["score"]["top_1"] == 1 and len(c["score"]["reported"]) == 1,
        _shown,
    )  # fmt: skip
    alarm = _largest(
        cases, lambda c: c["secret"]["kind"] == "null" and c["score"]["alarm"], _stated
    )
    wrong = _largest(cases, _misnamed, lambda c: (*_badly(c), *_shown(c)))
    forced = _largest(
        cases, lambda c: c["secret"]["kind"] == "unknown" and bool(c["score"]["reported"]), _shown
    )
    failures = [
        (ALARM, alarm),
        ("" if wrong is None else _how_wrong(cases[wrong]), wrong),
        (FORCED, forced),
    ]
    told = [(title, name) for title, name in failures if name is not None][:2]
    return told if success is None else [(FOUND, success), *told]


def _largest(
    cases: dict[str, Case], test: Callable[[Case], bool], rank: Callable[[Case], tuple[float, ...]]
) -> str | None:
    fit = [name for name, case in cases.items() if test(case)]
    return max(fit, key=lambda name: rank(cases[name])) if fit else None


def _shown(case: Case) -> tuple[float, ...]:
    """Rank by strength above weak, then by what perfect knowledge gains."""
    return float(case["secret"]["strength"] > 0), float(case["facts"].get("oracle_gain", 0.0))


def _stated(case: Case) -> tuple[float, ...]:
    """Rank by the largest probability that the answer states for anything at all."""
    stated = [float(e.get("probability") or 0.0) for e in case["effects"]]
    return (max([*stated, float(case.get("none_of_these") or 0.0)]),)


def _misnamed(case: Case) -> bool:
    """Whether a catalogued fault has a wrong name, or none."""
    score = case["score"]
    return case["secret"]["kind"] in ("one", "two", "decoy") and (
        score["precision"] < 1 or score["recall"] < 1
    )


def _badly(case: Case) -> tuple[float, ...]:
    """Rank weak faults last, then by a wrong first name, then by what else is wrong."""
    score = case["score"]
    precision = score["precision"] if score["reported"] else 1.0
    wrong = (1 - score["top_1"]) * bool(score["reported"])
    return float(case["secret"]["strength"] > 0), wrong, 2.0 - precision - score["recall"]


def _how_wrong(case: Case) -> str:
    score = case["score"]
    if not score["reported"]:
        return "A failure: a fault that was given no name"
    if score["top_1"] == 0:
        return "A failure: a fault called by a wrong name"
    if score["precision"] < 1:
        return "A failure: a wrong name beside the right one"
    return "A failure: one of two faults was given no name"
