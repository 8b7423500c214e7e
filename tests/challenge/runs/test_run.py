"""A run needs a sealed set."""

import json

import pytest

from challenge.runs.run import diagnosed_at, run


def test_run_refuses_an_unsealed_set(tmp_path):
    with pytest.raises(ValueError, match="commitments"):
        run(tmp_path, jobs=1, timeout_s=1.0)


def test_a_set_says_by_which_commits_it_was_diagnosed(tmp_path):
    for name, said in (("case-001", "abc"), ("case-002", "abd"), ("case-003", "abc")):
        answer = tmp_path / "answers" / name
        answer.mkdir(parents=True)
        (answer / "run.json").write_text(json.dumps({"code": 0, "commit": said}))
    assert diagnosed_at(tmp_path) == "abc, abd"
