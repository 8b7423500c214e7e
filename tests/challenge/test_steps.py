"""The steps of the challenge: make, run, judge, and the command line over them."""

import json
import shutil
import sys

import pytest

from challenge.judging.judge import judge
from challenge.runs.run import command, run
from challenge.sets import make as making
from flawforge.cli import main


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """Make a set of a single case with nothing missing, verified on few draws."""
    folder = tmp_path_factory.mktemp("set")
    counts = {"null": 1, "one": 0, "two": 0, "unknown": 0, "decoy": 0, "undecidable": 0}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("challenge.sets.make.counts_of", lambda _: counts)
        patch.setattr("challenge.cases.nulls.NULL_DRAWS", 25)
        assert making.make(folder, seed=3, cases=12, jobs=1) == 0
    return folder


def test_a_set_is_public_without_its_keys(sealed):
    public = json.loads((sealed / "commitments.json").read_text())
    assert list(public["cases"]) == ["case-001"]
    assert "seed" not in json.dumps(public)
    names = {p.name for p in (sealed / "cases" / "case-001").iterdir()}
    assert names == {
        "a.h5", "b.h5", "c.h5", "plate-1.h5", "plate-2.h5", "part.stl", "sensor.yaml",
    }  # fmt: skip


def test_making_again_changes_nothing_and_another_seed_is_refused(sealed):
    before = (sealed / "keys" / "case-001.seal.json").read_bytes()
    assert making.make(sealed, seed=None, cases=12, jobs=1) == 0
    assert (sealed / "keys" / "case-001.seal.json").read_bytes() == before
    with pytest.raises(ValueError, match="another seed"):
        making.make(sealed, seed=4, cases=12, jobs=1)


def test_run_shows_no_key_and_continues(sealed, monkeypatch):
    script = (
        "import json, pathlib\n"
        "here = sorted(str(p) for p in pathlib.Path('.').rglob('*'))\n"
        "pathlib.Path('diagnosis').mkdir()\n"
        "answer = {'verdict': 'match', 'effects': [], 'seen': here}\n"
        "pathlib.Path('diagnosis/diagnosis.json').write_text(json.dumps(answer))\n"
    )
    monkeypatch.setattr("challenge.runs.run.command", lambda *_: [sys.executable, "-c", script])
    assert run(sealed, jobs=1, timeout_s=60) == 0
    answer = sealed / "answers" / "case-001"
    seen = json.loads((answer / "diagnosis.json").read_text())["seen"]
    assert not any("key" in name or "npz" in name for name in seen)
    first = (answer / "run.json").read_bytes()
    assert run(sealed, jobs=1, timeout_s=60) == 0  # nothing left to do
    assert (answer / "run.json").read_bytes() == first
    assert judge(sealed)["cases"]["case-001"]["score"]["alarm"] is False
    assert judge(sealed)["seed"] == 3


def test_a_case_without_plates_or_baselines_is_diagnosed_without_them():
    words = command(["a.h5"], [])
    assert "--reference" not in words
    assert "--baseline" not in words
    words = command(["a.h5"], ["plate-1.h5"], ["base-1.h5", "base-2.h5"])
    assert words[words.index("--reference") + 1] == "plate-1.h5"
    assert words[words.index("--baseline") + 1 :][:2] == ["base-1.h5", "base-2.h5"]


def test_a_diagnosis_that_fails_is_kept_and_told(sealed, monkeypatch, tmp_path):
    copy = tmp_path / "set"
    shutil.copytree(sealed, copy, ignore=shutil.ignore_patterns("answers"))
    monkeypatch.setattr("challenge.runs.run.command", lambda *_: [sys.executable, "-c", "exit(2)"])
    assert run(copy, jobs=1, timeout_s=60) == 1
    case = judge(copy)["cases"]["case-001"]
    assert case["run"]["code"] == 2
    assert case["verdict"] == "none"


def test_command_line_says_what_is_missing(tmp_path, capsys):
    assert main(["challenge", "run", str(tmp_path)]) == 2
    assert "commitments" in capsys.readouterr().err
    assert main(["challenge", "judge", str(tmp_path)]) == 2


@pytest.mark.slow
def test_an_interrupted_run_leaves_no_answer_and_no_process(sealed, monkeypatch, tmp_path):
    copy = tmp_path / "set"
    shutil.copytree(sealed, copy, ignore=shutil.ignore_patterns("answers"))
    marker = tmp_path / "finished"
    script = (
        "import os, pathlib, signal, time\n"
        "os.kill(os.getppid(), signal.SIGINT)\n"
        f"time.sleep(20); pathlib.Path({str(marker)!r}).touch()\n"
    )
    monkeypatch.setattr("challenge.runs.run.command", lambda *_: [sys.executable, "-c", script])
    with pytest.raises(KeyboardInterrupt):
        run(copy, jobs=1, timeout_s=60)
    assert not (copy / "answers" / "case-001").exists()
    assert not marker.exists()
