"""Figures of a scoreboard on answers whose figures are known."""

import math

from challenge.cases.parameters import true_parameters
from challenge.judging.probabilities import stated_strange
from challenge.judging.side_answers import held, none_of_these
from challenge.proof.scoreboard import curve, figures, table
from challenge.sets.aims import AIMS, COVERAGE, NEXT, SHARE, TOP_1, UNKNOWN

NAN = float("nan")


def case(kind, *, switches=(), strength=1, alarm=False, top_1=NAN, recovered=NAN, **more):
    score = {
        "reported": [], "offered": [], "alarm": alarm, "top_1": top_1, "precision": top_1,
        "recall": top_1, "covered": top_1, "set_size": 1, "flagged": alarm, "iou": NAN,
        "recovered": recovered, "left": [],
    }  # fmt: skip
    secret = {"kind": kind, "switches": list(switches), "strength": strength, "family": "second"}
    return {
        "secret": {**secret, **more.pop("given", {})}, "facts": {"concealed": True},
        "run": {"code": 0, "seconds": 3.0}, "score": score, "effects": [], "intervals": [],
        "further": {"ranked": None, "random": None}, "boosted": None, "shuffled": None,
        "ceiling": NAN, "free_form_recovered": NAN, "pose_recovered": NAN, **more,
    }  # fmt: skip


def board(*cases):
    scored = {"cases": {str(k): c for k, c in enumerate(cases)}}
    return {f.name: f for f in figures(scored)}


def test_alarms_are_counted_with_their_interval_and_by_what_was_given():
    nulls = [case("null", alarm=k == 0, given={"baselines": 2 * (k % 2)}) for k in range(10)]
    found = board(*nulls)
    assert found["alarms on nulls"].value == "1 of 10, 95 % interval 0.003 to 0.445"
    assert found["alarms on nulls"].aim == "at most 2 of 60"
    assert found["- with baselines"].value == "0 of 5"
    assert found["- without baselines"].value == "1 of 5"


def test_what_was_reported_on_nulls_is_counted_by_null():
    nulls = [case("null", alarm=True) for _ in range(3)]
    for null in nulls[:2]:
        null["score"] |= {"reported": ["line_bow"], "left": ["scale over x"] * 2}
    assert board(*nulls)["- nulls with each"].value in {
        "line_bow 2, scale over x 2", "scale over x 2, line_bow 2"
    }
    assert board(case("null"))["- nulls with each"].value == "none"


def test_weak_cases_are_no_part_of_the_main_figures_and_shares_are_means():
    strong = case("one", switches=["worn roller"], top_1=1.0, recovered=0.5)
    weak = case("one", switches=["worn roller"], strength=0, top_1=0.0, recovered=1.0)
    found = board(strong, weak)
    assert found[TOP_1].value == "1.00 (1)"
    assert found["top-1, weak"].value == "0.00 (1)"
    assert found[SHARE].value == "0.75 (2)"


def test_unknowns_have_their_family_s_aim():
    found = board(case("unknown", switches=["hot air"], alarm=True))
    assert found[UNKNOWN].value.startswith("1 of 1")
    assert found[UNKNOWN].aim == ">= 0.85"


def test_an_undecidable_case_without_a_proposed_scan_counts_as_undecided():
    both = {"right": True, "alone": True}
    found = board(
        case("undecidable", further={"ranked": both, "random": None}),
        case("undecidable", further={"ranked": None, "random": both}),
    )
    assert found[NEXT].value.startswith("1 of 2")
    assert NEXT not in board(case("undecidable"))


def test_of_cases_without_a_proposed_scan_it_is_told_how_many_were_named_rightly():
    both = {"right": True, "alone": True}
    without = [
        case("undecidable", switches=["line_bow"], further={"ranked": None, "random": both})
        for _ in range(3)
    ]
    for one, name in zip(without, ("line_bow", "form_error", None), strict=True):
        one["score"]["reported"] = [name] if name else []
    found = board(*without)
    assert found["  - no scan proposed: right name first"].value.startswith("1 of 3")


def test_top_1_is_told_by_evidence_and_by_baselines():
    cases = [
        case("one", top_1=float(right), given={"baselines": baselines},
             facts={"concealed": True, "oracle_z": z})
        for right, baselines, z in ((1, 2, 30.0), (0, 2, 12.0), (1, 0, 12.0), (1, 0, 3.0))
    ]  # fmt: skip
    found = board(*cases)
    assert found["  - beyond 24 sigma"].value == "1.00 (1)"
    assert found["  - up to 24 sigma"].value == "0.50 (2)"
    assert found["  - with baselines"].value == "0.50 (2)"
    assert found["  - without baselines"].value == "1.00 (1)"
    assert found["  - no name at all"].value == "3 of 3"


def test_intervals_are_counted_over_all_cases():
    found = board(case("one", intervals=[True, True]), case("two", intervals=[False]))
    assert found[COVERAGE].value.startswith("2 of 3")


def test_an_interval_holds_its_parameter_or_not_and_none_is_none():
    answer = {"effects": [{"name": "stage_vibration", "parameters": {
        "amplitude_um": {"value": 4.0, "low": 3.0, "high": 5.0},
        "frequency_hz": {"value": 20.0, "low": 19.0, "high": 21.0},
        "phase_rad": {"value": 1.0}}}]}  # fmt: skip
    true = {"stage_vibration": {"amplitude_um": 4.5, "frequency_hz": 23.0, "phase_rad": 1.0}}
    assert held(true, answer) == [True, False]
    assert held({}, answer) == []
    assert held(true, None) == []


def test_true_parameters_come_of_the_key_or_of_what_was_set():
    assert true_parameters({"parameters": {"line_bow": {"sag_um": 3.0}}}, ()) == {
        "line_bow": {"sag_um": 3.0}
    }
    switched = {
        "motion": {"shake_mm": 0.005, "shake_hz": 20.0, "ripple_mm": 0.0, "ripple_period_mm": 3.0},
        "faults": {"lost_share": 0.0}, "plan": {"gauge_stretch": 1e-3},
        "sheet": {"exposure_s": 1e-4},
    }  # fmt: skip
    found = true_parameters({"switched": switched}, ("range_scale",))
    assert math.isclose(found["range_scale"]["error_ppm"], -999.000999, rel_tol=1e-6)
    assert set(found) == {"range_scale"}


def test_none_of_these_is_read_as_a_number_or_an_entry_and_counts_where_something_is_hidden():
    assert none_of_these({"none_of_these": 0.2}) == 0.2
    assert none_of_these({"none_of_these": {"probability": 0.3}}) == 0.3
    assert none_of_these({}) is None
    assert stated_strange({**case("unknown"), "none_of_these": 0.9}) == [(0.9, True)]
    assert stated_strange({**case("one"), "none_of_these": 0.1}) == [(0.1, False)]
    assert stated_strange({**case("null"), "none_of_these": 0.1}) == []


def test_every_aim_is_one_of_a_figure_and_those_of_the_set_count():
    names = set(board(case("undecidable", further={"ranked": {"right": True, "alone": True},
                                                   "random": None})))  # fmt: skip
    for aims in AIMS.values():
        assert set(aims) <= names
    frozen = {"protocol": {"aims": {"second": {TOP_1: ">= 0.5"}}}}
    found = figures({**frozen, "cases": {"1": case("one", switches=["hot air"], top_1=1.0)}})
    assert {f.aim for f in found} == {"", ">= 0.5"}


def test_two_families_are_two_columns_and_a_curve_needs_probabilities():
    one = figures({"cases": {"1": case("null")}})
    lines = table({"first": one, "second": one})
    assert lines[0] == "| figure | first | aim | second | aim |"
    assert all(line.count("|") == 6 for line in lines)
    assert curve({"cases": {"1": case("null")}}) == ["The answers state no probabilities."]
    told = case("one", switches=["worn roller"])
    told["effects"] = [{"name": "travel_ripple", "probability": 0.95}]
    assert "| 0.95 | 1.00 | 1 |" in curve({"cases": {"1": told}})
