"""A signal that asks to stop is never lost, whatever becomes of the exception it raises."""

import importlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flawforge.cli import main
from flawforge.commands import generate as generate_command
from pipeline.batch import stop
from pipeline.batch.stop import Stopped, heard, stoppable

HOME = Path(__file__).resolve().parents[3]
LONG_S = 60.0  # a wish that is lost fails the test after this


class Swallows:
    """Python prints what is raised in `__del__` and forgets it."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __del__(self) -> None:
        signal.raise_signal(self.number)


def swallow(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    lost: list[type[BaseException]] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda found: lost.append(found.exc_type))
    Swallows(number)
    assert lost == [Stopped]


def work() -> None:
    end = time.monotonic() + LONG_S
    while time.monotonic() < end:
        pass


def load_and_work(module: str) -> None:
    importlib.import_module(module)
    work()


@pytest.mark.parametrize("number", stop.SIGNALS)
def test_a_wish_that_was_swallowed_is_repeated(number, monkeypatch):
    monkeypatch.setattr(stop, "REPEAT_S", 0.01)
    with stoppable():
        swallow(number, monkeypatch)
        with pytest.raises(Stopped):
            work()
        assert heard() == number


def test_a_wish_waits_for_a_module_that_loads(tmp_path, monkeypatch):
    (tmp_path / "slow_to_load.py").write_text(
        "import signal\nsignal.raise_signal(signal.SIGTERM)\nwhole = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with stoppable():
        with pytest.raises(Stopped):
            load_and_work("slow_to_load")
        assert heard() == signal.SIGTERM
    assert sys.modules.pop("slow_to_load").whole


def test_who_heard_the_wish_isnt_interrupted_again(monkeypatch):
    monkeypatch.setattr(stop, "REPEAT_S", 0.01)
    with stoppable():
        with pytest.raises(Stopped):
            signal.raise_signal(signal.SIGINT)
        assert heard() == signal.SIGINT
        signal.raise_signal(signal.SIGTERM)
        time.sleep(0.03)


def test_signals_are_as_before_afterwards():
    numbers = (*stop.SIGNALS, signal.SIGALRM)
    before = [signal.getsignal(number) for number in numbers]
    with stoppable():
        assert signal.getsignal(signal.SIGTERM) != before[1]
        assert heard() is None
    assert [signal.getsignal(number) for number in numbers] == before


def test_a_signal_that_is_ignored_stays_so():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stoppable():
            signal.raise_signal(signal.SIGINT)
            assert heard() is None
    finally:
        signal.signal(signal.SIGINT, before)


def test_exit_code_though_it_passed_an_exec(tmp_path):
    (tmp_path / "interrupted.py").write_text(
        "import signal, sys\n"
        "from pipeline.batch.stop import heard, stoppable\n"
        "with stoppable():\n"
        "    try:\n"
        "        exec('signal.raise_signal(signal.SIGINT)')\n"
        "    except BaseException:\n"
        "        sys.exit(128 + heard())\n"
    )
    run = subprocess.run(
        [sys.executable, "-m", "interrupted"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(HOME)}, check=False,
    )  # fmt: skip
    assert run.returncode == 130


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("becomes", [None, ImportError, SystemError, SystemExit])
def test_the_command_ends_as_asked(number, code, becomes, tmp_path, monkeypatch, capsys):
    def run(arguments: object) -> int:
        swallow(number, monkeypatch)
        try:
            work()
        except Stopped:
            if becomes is not None:  # as compiled code does
                raise becomes("something else") from None
            raise
        return 0

    monkeypatch.setattr(stop, "REPEAT_S", 0.01)
    monkeypatch.setattr(generate_command, "run", run)
    assert main(["generate", "recipe.yaml", "--out", str(tmp_path)]) == code
    assert "continues from there" in capsys.readouterr().err


def test_an_error_without_a_wish_is_no_stop(tmp_path, monkeypatch, capsys):
    def run(arguments: object) -> int:
        raise SystemError("something else")

    monkeypatch.setattr(generate_command, "run", run)
    assert main(["generate", "recipe.yaml", "--out", str(tmp_path)]) == 2
    assert "an error of ours (SystemError: something else)" in capsys.readouterr().err


class Fails:
    """Raises what isn't a wish to stop."""

    def __del__(self) -> None:
        raise ValueError("told")


def test_errors_that_python_forgets_are_printed_until_a_wish(monkeypatch):
    told: list[type[BaseException]] = []

    def hook(found):
        told.append(found.exc_type)

    monkeypatch.setattr(sys, "unraisablehook", hook)
    with stoppable():
        Fails()
        assert told == [ValueError]
        Swallows(signal.SIGTERM)
        Fails()  # as what the exception left half made
        assert told == [ValueError]
    assert sys.unraisablehook is hook
