"""How the command line's process ends: with its exit code, and what is to be done at exit done."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flawforge import cli

HOME = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(("words", "code"), [(["--version"], 0), (["verify", "missing"], 2)])
def test_what_is_to_be_done_at_exit_is_done_and_the_code_stays(words, code):
    text = (
        "import atexit, sys\n"
        "from flawforge import cli\n"
        f"sys.argv[1:] = {words!r}\n"
        "def main(main=cli.main):\n"
        "    atexit.register(print, 'done')\n"
        "    return main()\n"
        "cli.main = main\n"
        "cli.command()\n"
    )
    run = subprocess.run([sys.executable, "-c", text], cwd=HOME, capture_output=True, text=True)
    assert run.returncode == code, run.stderr
    assert run.stdout.splitlines()[-1] == "done"


@pytest.mark.parametrize(("words", "code"), [(["--help"], 0), (["generate"], 2)])
def test_the_parser_s_own_exits_keep_their_code(words, code):
    run = subprocess.run(
        [sys.executable, "-m", "flawforge.cli", *words], cwd=HOME, capture_output=True, text=True
    )
    assert run.returncode == code
    assert run.stdout or run.stderr


def test_a_fault_is_shown_and_counts_as_one():
    text = "from flawforge import cli\ncli.main = lambda: 1 / 0\ncli.command()\n"
    run = subprocess.run([sys.executable, "-c", text], cwd=HOME, capture_output=True, text=True)
    assert run.returncode == 1
    assert "ZeroDivisionError" in run.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", ["generate", "diagnose", "import"])
def test_a_command_that_is_stopped_says_whether_it_goes_on(name, number, monkeypatch, capsys):
    words = {
        "generate": ["recipe.yaml", "--out", "o"],
        "diagnose": ["a.h5", "--part", "p.stl", "--sensor", "s.yaml", "--out", "o"],
        "import": ["a.csv", "--as", "a.h5"],
    }

    def run(arguments):
        signal.raise_signal(number)
        raise AssertionError("wasn't stopped")

    monkeypatch.setattr(cli.command_module(name), "run", run)
    assert cli.main(["--debug", name, *words[name]]) == 128 + number
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert ("continues from there" in said) == (name == "generate")
    assert ("starts from the beginning" in said) == (name != "generate")
