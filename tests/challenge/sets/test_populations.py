"""Three populations by rule: what judges sets nothing, and a test set is never opened."""

import json
from pathlib import Path

import pytest

from challenge.judging.judge import judge
from challenge.proof.record_of_tests import enter
from challenge.sets.populations import POPULATIONS, TEST, VALIDATION, needs_aggregate

ROOT = Path(__file__).parents[3]


def test_no_set_belongs_to_two_populations():
    members = [m for p in POPULATIONS.values() for m in p.members]
    assert len(members) == len(set(members))


def test_nothing_in_the_diagnosis_names_a_population_that_judges():
    for file in (ROOT / "diagnosis").rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        named = [m for m in (*TEST.members, *VALIDATION.members) if m in text]
        assert not named, f"{file.relative_to(ROOT)} takes a number from {named}"


def test_a_test_set_is_judged_in_aggregate_only(tmp_path):
    (tmp_path / "commitments.json").write_text(json.dumps({"population": "test", "cases": {}}))
    with pytest.raises(ValueError, match="--aggregate only"):
        judge(tmp_path)


def test_an_unknown_population_is_refused():
    assert not needs_aggregate("calibration")
    assert needs_aggregate("test")
    with pytest.raises(ValueError, match="allowed: calibration, validation, test"):
        needs_aggregate("holiday")


def test_every_test_run_is_entered_with_commit_and_reason(tmp_path):
    file = tmp_path / "record.md"
    enter(file, reason="first run", commit="abc", lines=["| alarms | 0 |"])
    enter(file, reason="second run", commit="def", lines=["| alarms | 1 |"])
    text = file.read_text()
    assert text.index("abc") < text.index("first run") < text.index("def")
    assert "| alarms | 1 |" in text
    with pytest.raises(ValueError, match="--reason"):
        enter(file, reason=" ", commit="abc", lines=[])


def test_the_record_begins_with_the_figures_of_all_runs(tmp_path):
    file = tmp_path / "record.md"
    for alarms in ("1 of 9, 95 % interval 0.003 to 0.483", "0 of 9"):
        table = ["| figure | one (test) | other | aim |", f"| alarms on nulls | {alarms} | 2 | |"]
        enter(file, reason="a run", commit=f"c{alarms[0]}", lines=table)
    glance = file.read_text().split("## ")[1]
    rows = [line for line in glance.splitlines() if ", c" in line]
    assert [row.split(" | ")[1:3] for row in rows] == [
        ["one (test)", "1 of 9"], ["other", "2"], ["one (test)", "0 of 9"], ["other", "2"],
    ]  # fmt: skip
