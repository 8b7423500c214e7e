"""An error that nobody thought of is one line, its report kept; exit code 2."""

from pathlib import Path

import pytest

from flawforge import cli


@pytest.fixture
def broken(monkeypatch):
    def set_error(error):
        class Module:
            @staticmethod
            def add_arguments(parser):
                pass

            @staticmethod
            def run(arguments):
                raise error

        monkeypatch.setattr(cli, "command_module", lambda name: Module)

    return set_error


def test_one_line_and_a_report(broken, capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    broken(KeyError("somewhere\ndeep"))
    assert cli.main(["verify"]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "Traceback" not in said
    (kept,) = tmp_path.glob("flawforge-crash-*.txt")
    assert str(kept) in said
    assert "KeyError" in Path(kept).read_text()
    assert "Traceback" in Path(kept).read_text()


def test_memory_is_said_as_such_and_debug_shows_where(broken, capsys):
    broken(MemoryError())
    assert cli.main(["verify"]) == 2
    assert "not enough memory" in capsys.readouterr().err
    broken(ZeroDivisionError("x"))
    with pytest.raises(ZeroDivisionError):
        cli.main(["--debug", "verify"])
