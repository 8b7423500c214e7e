"""The command line as a newcomer meets it."""

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
    with pytest.raises(SystemExit) as caught:
        main([name, "--help"])
    assert caught.value.code == 0
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
