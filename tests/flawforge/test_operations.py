"""What docs/operations.md says of surroundings: streams, locale, home, umask, folders that go."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[2]
VERIFY = f"{sys.executable} -m flawforge.cli verify $DATASET"


def shell(script: str, dataset: Path, **more: str) -> subprocess.CompletedProcess[str]:
    known = {"PATH": os.environ["PATH"], "PYTHONPATH": str(HOME), "DATASET": str(dataset)}
    return subprocess.run(
        ["bash", "-c", script], env=known | more, capture_output=True, text=True, check=False,
        timeout=300,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("script", "code"),
    [
        (VERIFY, 0),
        (f"{VERIFY} >&-", 0),
        (f"{VERIFY} <&- >&- 2>&-", 0),
        (f"{VERIFY} | head -1; exit ${{PIPESTATUS[0]}}", 0),
        (f"{VERIFY} | true; exit ${{PIPESTATUS[0]}}", 1),
        pytest.param(
            f"{VERIFY} >/dev/full", 2,
            marks=pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here"),
        ),
    ],
)  # fmt: skip
def test_streams_and_a_bare_environment(script, code, small_dataset):
    run = shell(script, small_dataset, LANG="C")  # and no HOME
    assert run.returncode == code, run.stderr
    assert "Traceback" not in run.stderr
    assert run.stderr.count("\n") <= 1


def test_a_dataset_that_goes_while_it_is_verified(small_dataset, tmp_path):
    shutil.copytree(small_dataset, tmp_path / "half")
    (tmp_path / "half" / "shard-00000.h5").unlink()
    run = shell(VERIFY, tmp_path / "half")
    assert run.returncode == 1
    assert "shard-00000.h5" in run.stdout + run.stderr
    assert "Traceback" not in run.stderr
