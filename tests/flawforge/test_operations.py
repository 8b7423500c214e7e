"""docs/operations.md, by test: streams, locale, home, umask, folders that go."""

import itertools
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flawforge.cli import main
from pipeline.dataset.checksums import own_files
from tests.support.mounts import read_only
from tests.support.small_recipe import write_shards

HOME = Path(__file__).resolve().parents[2]
FLAWFORGE = f"{sys.executable} -m flawforge.cli"
VERIFY = f"{FLAWFORGE} verify $DATASET"
full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")


def shell(
    script: str, dataset: Path, cwd: Path | None = None, **more: str
) -> subprocess.CompletedProcess[str]:
    known = {"PATH": os.environ["PATH"], "PYTHONPATH": str(HOME), "DATASET": str(dataset)}
    return subprocess.run(
        ["bash", "-c", script], env=known | more, capture_output=True, text=True, check=False,
        timeout=300, cwd=cwd,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("script", "code"),
    [
        (VERIFY, 0),
        (f"{VERIFY} >&-", 0),
        (f"{VERIFY} <&- >&- 2>&-", 0),
        (f"{VERIFY} | head -1; exit ${{PIPESTATUS[0]}}", 0),
        (f"{VERIFY} | true; exit ${{PIPESTATUS[0]}}", 1),
        pytest.param(f"{VERIFY} >/dev/full", 2, marks=full),
        pytest.param(f"{FLAWFORGE} verify nothing 2>/dev/full", 2, marks=full),
        pytest.param(f"{FLAWFORGE} verify 2>/dev/full", 2, marks=full),
        pytest.param(f"{FLAWFORGE} --help >/dev/full", 2, marks=full),
        pytest.param(f"{FLAWFORGE} generate --help >/dev/full", 2, marks=full),
        pytest.param(f"{FLAWFORGE} --version >/dev/full", 2, marks=full),
        (f"{FLAWFORGE} --help >&-", 0),
        (f"{FLAWFORGE} --help | true; exit ${{PIPESTATUS[0]}}", 1),
    ],
)
@pytest.mark.parametrize("unbuffered", ["", pytest.param("1", marks=pytest.mark.slow)])
def test_streams_and_a_bare_environment(script, code, unbuffered, small_dataset):
    more = {"LANG": "C", "PYTHONUNBUFFERED": unbuffered}
    run = shell(script, small_dataset, **more)  # and no HOME
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


@pytest.mark.slow
def test_a_read_only_installation_and_home(tmp_path):
    """Compiled loops are kept in a folder of the user's own, or numba would refuse to load."""
    (tmp_path / "home").mkdir()
    script = (
        "import os, pipeline, sensors.noise.window_filters as filters, numpy as np;"
        "print(os.environ['NUMBA_CACHE_DIR'], filters.__file__)"
    )
    with (
        read_only(HOME, tmp_path / "installed") as installed,
        read_only(tmp_path / "home", tmp_path / "mine") as home,
    ):
        environment = {
            "PATH": os.environ["PATH"], "PYTHONPATH": str(installed), "HOME": str(home),
            "TMPDIR": str(tmp_path),
        }  # fmt: skip
        run = subprocess.run(
            [sys.executable, "-c", script], env=environment, cwd=tmp_path, capture_output=True,
            text=True, check=False,
        )  # fmt: skip
    assert run.returncode == 0, run.stderr
    cache, file = run.stdout.split()
    assert cache == str(tmp_path / f"flawforge-loops-{os.getuid()}")
    assert file.startswith(str(installed))


@pytest.mark.parametrize(
    "change",
    [
        {"specimens": "many"},
        {"parts": [{"builtin": "no_such_part"}]},
        {"parts": [{"path": "missing.stl"}]},
        {"motion": {"length_mm": 1e9}},
        {"flaws": {"dent": {"number": 200}, "min_distance_mm": 1000}},
    ],
)
def test_json_lines_stay_json_on_errors(change, tmp_path, capfd):
    recipe = write_shards(tmp_path, **{"specimens": 1, "scans": 1, **change})
    words = ["generate", str(recipe), "--out", str(tmp_path / "out"), "--log-json"]
    code = main(words)
    printed = capfd.readouterr()
    events = [json.loads(line)["event"] for line in printed.out.splitlines()]
    assert printed.err.count("flawforge: ") == (1 if code == 2 else 0)
    assert code == 2 or {"warning", "done"} <= set(events)


def test_the_clock_may_go_back(tmp_path, monkeypatch):
    recipe = write_shards(tmp_path, specimens=2)
    assert main(["generate", str(recipe), "--out", str(tmp_path / "as-it-is")]) == 0
    seconds = itertools.count(1e9, -3600.0)
    monkeypatch.setattr(time, "time", lambda: next(seconds))
    assert main(["generate", str(recipe), "--out", str(tmp_path / "back")]) == 0
    for name in own_files(tmp_path / "back"):
        assert (tmp_path / "back" / name).read_bytes() == (
            tmp_path / "as-it-is" / name
        ).read_bytes()


def test_a_pipe_in_the_place_of_a_part_is_never_waited_for(tmp_path, small_dataset):
    write_shards(tmp_path, parts=[{"path": "a.stl"}])
    os.mkfifo(tmp_path / "a.stl")
    run = shell(f"{FLAWFORGE} generate recipe.yaml --out out", small_dataset, cwd=tmp_path)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "a.stl: not a file" in run.stderr
