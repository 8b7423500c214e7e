"""The command line as a newcomer meets it."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from flawforge.cli import COMMANDS, main

ROOT = Path(__file__).resolve().parents[2]


def test_help_names_every_command(capsys):
    assert main([]) == 0
    text = capsys.readouterr().out
    for name in COMMANDS:
        assert name in text


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_explains_itself(name, capsys):
    assert main([name, "--help"]) == 0
    text = capsys.readouterr().out
    assert "example" in text
    assert len(text) > 300


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from flawforge.cli import main; main([]); "
        "heavy = {'numpy', 'scipy', 'pandas', 'h5py', 'numba', 'trimesh'} & set(sys.modules);"
        "sys.exit(f'loaded {heavy}' if heavy else 0)"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def test_bad_input_is_one_line_and_exit_code_2(tmp_path, capsys):
    bad = tmp_path / "bad.yaml"
    bad.write_text("name: x\nseed: 1\n")
    assert main(["generate", str(bad), "--out", str(tmp_path / "out")]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert str(bad) in captured.err
    assert not (tmp_path / "out").exists()
    with pytest.raises(ValueError, match="missing"):
        main(["--debug", "generate", str(bad), "--out", str(tmp_path / "out")])


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("flawforge 0.")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["diagnoze"], "no such command, got 'diagnoze'; did you mean 'diagnose'?"),
        (["frobnicate"], "no such command, got 'frobnicate'; allowed: init, generate, check"),
        (["generate", "qickstart", "--out", "o"], "'qickstart'; did you mean 'quickstart'?"),
        (["preview", "nodir"], "allowed: the folder of a dataset, a .yaml file or one of quickst"),
        (["preview", "missing.yaml"], "missing.yaml:5: "),
    ],
)
def test_a_wrong_name_is_one_line_with_the_nearest_that_is_known(
    words, said, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("missing.yaml").write_text(
        "name: a\nseed: 1\nsensor: KEYENCE-LJ-X8200\nparts:\n  - path: none.stl\nprofiles: 20\n"
    )
    assert main(words) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1


def test_a_folder_of_a_recipes_name_is_previewed_with_a_word(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("quickstart").mkdir()
    assert main(["preview", "quickstart"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "'quickstart' is a folder and a recipe: its dataset is drawn"
    assert "no dataset here" in said[1]


@pytest.mark.parametrize("words", [["--jobs", "-1"], ["--jobs", "many"], ["--job"], ["--bakend"]])
def test_a_wrong_word_is_one_line_and_exit_code_2(words, tmp_path, capsys):
    assert main(["generate", "recipe.yaml", "--out", str(tmp_path / "out"), *words]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert "flawforge generate --help" in captured.err
    assert captured.out == ""


def test_a_run_without_a_usable_part_leaves_nothing(tmp_path, capsys):
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(
        "name: x\nseed: 1\nsensor: KEYENCE-LJ-X8200\nprofiles: 2\npoints: 2\n"
        "parts:\n  - builtin: steel_plate\n    parameters: {length_mm: -1}\n"
    )
    out = tmp_path / "new" / "out"
    assert main(["generate", str(recipe), "--out", str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not out.parent.exists()
    out.mkdir(parents=True)  # a folder that was there stays
    assert main(["generate", str(recipe), "--out", str(out)]) == 2
    assert list(out.iterdir()) == []


def test_a_summary_keeps_to_a_few_lines_of_a_kind():
    from flawforge.summary import MOST_LINES, summary

    dropped = [{"specimen": f"a-{number:04d}", "why": "too near"} for number in range(500)]
    said = summary(
        {
            "scans": 1,
            "shards": {"shard-00000.h5": {}},
            "split_by": "part",
            "statistics": {"scans_by_split": {"train": 1}, "by_split": {"train": {}}},
            "warnings": [],
            "parts": [],
            "flaws_dropped": dropped,
            "failed": [{"part": "b", "scan": "b-0000-0000", "why": "b: nothing seen"}],
        },
        ROOT,
    ).splitlines()
    assert said[0].startswith("1 scan in 1 shard in ")
    assert said[-2] == "... and 490 more, see 'flaws_dropped' in dataset.json"
    assert said[-1] == "failed: b-0000-0000: nothing seen"
    assert len(said) == MOST_LINES + 4


def test_what_the_system_refuses_is_one_line(tmp_path, capfd, monkeypatch):
    import flawforge.commands.verify

    def full(arguments):
        raise OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "x"))

    monkeypatch.setattr(flawforge.commands.verify, "run", full)
    assert main(["verify", str(tmp_path)]) == 2
    assert capfd.readouterr().err == (
        f"flawforge: {tmp_path}/x: the system says: No space left on device\n"
    )

    def piped(arguments):
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr(flawforge.commands.verify, "run", piped)
    monkeypatch.setattr(os, "dup2", lambda *descriptors: None)
    assert main(["verify", str(tmp_path)]) == 1
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["preview", "{}", "--part", "a"], "--part selects a part of a recipe"),
        (["preview", "{}/r.yaml", "--scan", "a"], "--scan selects a scan of a dataset"),
        (["preview", "{}", "--out", "x.doc"], "allowed: NAME.png"),
        (["verify", "{}", "--write"], "--write requires --lock"),
        (["generate", "{}/r.yaml", "--out", "{}/o", "--parts", "{}/no"], "no such folder"),
    ],
)
def test_words_that_dont_fit_are_one_line(words, said, tmp_path, capsys):
    (tmp_path / "r.yaml").write_text(
        "name: x\nseed: 1\nsensor: KEYENCE-LJ-X8200\nprofiles: 2\nparts: [{builtin: car_door}]\n"
    )
    assert main([word.format(tmp_path) for word in words]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert said in captured.err
    assert [path.name for path in tmp_path.iterdir()] == ["r.yaml"]


def test_a_lock_that_cant_be_written_leaves_nothing(tmp_path):
    from files.whole_file import write_whole

    (tmp_path / "x.lock").mkdir()
    with pytest.raises(OSError, match="directory"):
        write_whole(tmp_path / "x.lock", "{}")
    assert [path.name for path in tmp_path.iterdir()] == ["x.lock"]
