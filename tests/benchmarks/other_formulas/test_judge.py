"""The judge on answers whose figures are known beforehand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.other_formulas import page
from benchmarks.other_formulas.judge import (
    Answer,
    coverage,
    first_names,
    flagged,
    interval,
    precision,
    recall,
    stated,
    wrongly_sure,
)  # fmt: skip
from benchmarks.other_formulas.page import write_page
from benchmarks.other_formulas.run import committed_s


def answer(effects, sets, *, also=None, verdict="explained", sure=None, chances=()):
    truth = {"effects": effects, "also": also or [[] for _ in effects]}
    return Answer(
        truth=truth, run={}, verdict=verdict, sets=tuple(sets),
        sure=tuple(sure or [None] * len(sets)), chances=tuple(chances), none_of_these=None,
    )  # fmt: skip


def test_sets_count_as_they_are_offered():
    offered = answer(["line_bow"], [("form_error", "line_bow")])
    assert recall([offered]) == (1, 1)
    assert precision([offered]) == (1, 1)
    assert first_names([offered]) == (0, 1)


def test_a_second_name_for_one_cause_is_a_false_one():
    twice = answer(["line_bow"], [("line_bow",), ("form_error", "line_bow")])
    assert precision([twice]) == (1, 2)


def test_a_failed_diagnosis_is_a_miss_and_no_flag():
    failed = answer(["line_bow"], [], verdict=None)
    assert recall([failed]) == (0, 1)
    assert flagged([answer([], [], verdict=None)]) == (0, 1)


def test_names_that_recordings_cannot_tell_apart_are_right():
    assert recall([answer(["a"], [("b",)], also=[["b"]])]) == (1, 1)


def test_a_name_without_probability_is_a_sure_one():
    assert wrongly_sure([answer([], [("x",)])]) == (1, 1)
    assert wrongly_sure([answer([], [("x",)], sure=[0.4])]) == (0, 1)


def test_probabilities_are_held_against_what_was_hidden():
    fair = [answer(["a"] if k < 7 else ["c"], [], chances=[("a", 0.7)]) for k in range(10)]
    assert stated(fair) == [(0.7, True)] * 7 + [(0.7, False)] * 3
    assert not stated([answer(["a"], [("a",)])])


def test_interval_of_none_of_a_hundred():
    low, high = interval(0, 100)
    assert low == 0.0
    assert high == pytest.approx(1 - 0.025 ** (1 / 100))


def test_coverage_counts_intervals_of_laws_that_were_named():
    true = {"effects": ["a"], "also": [[]], "parameters": {"a": {"x": 1.0, "y": 2.0, "z": 0.0}}}
    stated = {"x": {"low": 0.5, "high": 1.5}, "y": {"low": 0.0, "high": 1.0}, "z": {"value": 0.0}}
    base = answer(["a"], [("a",)])
    named = replace(base, truth=true, parameters=(("a", stated), ("b", stated)))
    assert coverage([named]) == (1, 2)


def test_the_page_opens_no_case_of_validation_and_test(tmp_path):
    truth = {
        "name": "one-001", "kind": "one", "formulas": ["arc"], "wanted": 12, "part": "hills",
        "baselines": True, "effects": ["line_bow"], "also": [[]],
    }  # fmt: skip
    run = {"code": 0, "seconds": 3.0, "baselines_used": False}
    said = {"verdict": "explained", "effects": [{"name": "line_bow"}]}
    for seed in (0, 100, 200):
        folder = tmp_path / "abc" / f"seed-{seed}" / "one-001"
        folder.mkdir(parents=True)
        for file, content in (("truth", truth), ("run", run), ("diagnosis", said)):
            (folder / f"{file}.json").write_text(json.dumps(content))
    write_page(tmp_path, tmp_path / "page.md")
    validation, test, calibration = (tmp_path / "page.md").read_text().split("\n## ")[-3:]
    assert "| recall, signal to noise 12 with baselines | 1.00 (1 of 1" in test
    assert "commit abc" in test
    assert "line_bow" in calibration
    assert "line_bow" not in validation + test


def test_the_page_begins_with_the_newest_commit(tmp_path, monkeypatch):
    when_s = {"c": 300.0, "a": 200.0, "b": 100.0, "unknown": -np.inf}
    monkeypatch.setattr(page, "committed_s", when_s.__getitem__)
    stored = ["unknown/seed-1", "b/seed-200", "b/seed-0", "b/seed-101", "a/seed-9", "c/seed-103"]
    found = page.newest_first(tmp_path / one for one in stored)
    assert [f"{f.parent.name}/{f.name}" for f in found] == [
        "c/seed-103", "a/seed-9", "b/seed-101", "b/seed-200", "b/seed-0", "unknown/seed-1",
    ]  # fmt: skip


def test_a_commit_that_git_does_not_know_is_the_oldest():
    assert committed_s("0" * 40) == -np.inf
    assert committed_s("HEAD-dirty") == committed_s("HEAD")
