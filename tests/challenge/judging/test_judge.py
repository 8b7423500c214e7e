"""The judge opens keys, checks seals, and scores a set."""

import json
import shutil

import pytest

from challenge.baseline.shuffle import SHUFFLED
from challenge.judging.judge import judge
from challenge.proof.page import Judged, stopped
from challenge.proof.scoreboard import figures, table
from tests.support.answers import answer


def test_judge_scores_the_shuffled_baseline(judged):
    shutil.copytree(judged / "answers", judged / SHUFFLED)
    shuffled = judged / SHUFFLED / "case-001" / "diagnosis.json"
    shuffled.write_text(json.dumps(answer("explained", "thermal_drift")))
    scored = judge(judged)
    assert scored["cases"]["case-001"]["shuffled"]["top_1"] == 0
    board = "\n".join(table({"first": figures(scored)}))
    assert "| shuffled covariates: top-1, one effect (chance is right) | 0.00 (1) |" in board
    assert "| - the same cases as they are | 1.00 (1) |" in board


def test_judge_refuses_a_changed_key(judged):
    key = judged / "keys" / "case-001.key.json"
    key.write_bytes(key.read_bytes().replace(b"line_bow", b"form_err"))
    with pytest.raises(ValueError, match="not the one that was committed"):
        judge(judged)


def test_a_run_that_the_clock_stopped_is_judged_only_where_asked(judged):
    public = json.loads((judged / "commitments.json").read_text())
    name = next(iter(public["cases"]))
    (judged / "answers" / name / "run.json").unlink()
    with pytest.raises(ValueError, match="no answer yet"):
        judge(judged)
    scored = judge(judged, partial=True)
    assert scored["sealed"] == len(public["cases"])
    assert len(scored["cases"]) == scored["sealed"] - 1
    assert f"{scored['sealed'] - 1} of {scored['sealed']} sealed cases" in stopped(
        Judged.of(scored, judged)
    )[0]
