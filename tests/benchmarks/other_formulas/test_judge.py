"""The judge on answers whose figures are known beforehand."""

from dataclasses import replace

import pytest

from benchmarks.other_formulas.judge import (
    Answer,
    calibration_error,
    coverage,
    first_names,
    flagged,
    interval,
    precision,
    recall,
    reliability,
    wrongly_sure,
)  # fmt: skip


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


def test_calibration_error_of_a_perfect_and_of_a_boastful_diagnosis():
    fair = [answer(["a"] if k < 7 else ["c"], [], chances=[("a", 0.7)]) for k in range(10)]
    assert calibration_error(reliability(fair)) == pytest.approx(0.0)
    boast = [answer(["c"], [], chances=[("a", 0.9)]) for _ in range(4)]
    assert calibration_error(reliability(boast)) == pytest.approx(0.9)
    assert calibration_error(reliability([answer(["a"], [])])) is None


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
