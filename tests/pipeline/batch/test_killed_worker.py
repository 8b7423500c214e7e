"""A worker that is killed: one line, and the same command goes on to the same bytes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline.batch.run import generate
from pipeline.dataset.checksums import own_files
from pipeline.recipe import Recipe
from tests.support.small_recipe import write_shards

HOME = Path(__file__).resolve().parents[3]


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """Return the processes that compute for a command: its forks, or those that loky started."""
    if not Path("/proc/self/task").exists():
        pytest.skip("no /proc here: workers can't be found")
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    lines = {int(pid): Path(f"/proc/{pid}/cmdline").read_bytes() for pid in children}
    same = Path(f"/proc/{process.pid}/cmdline").read_bytes()
    return [pid for pid, line in lines.items() if line == same or b"popen_loky_posix" in line]


@pytest.mark.slow
def test_a_killed_worker(tmp_path):
    recipe = write_shards(tmp_path, specimens=8, scans=4)
    generate(Recipe.load(recipe), tmp_path / "whole")
    command = [
        sys.executable, "-m", "flawforge.cli", "generate", str(recipe), "--jobs", "2", "--out",
        str(tmp_path / "out"),
    ]  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(HOME)}
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    end = time.monotonic() + 120.0
    while not list((tmp_path / "out").glob("shard-*.h5")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)
    (worker,) = workers_of(process)
    os.kill(worker, signal.SIGKILL)
    _, said = process.communicate(timeout=120.0)
    assert process.returncode == 2, said
    errors = [line for line in said.splitlines() if line.startswith("flawforge: ")]
    assert len(errors) == 1
    assert "--jobs" in errors[0]
    assert "a worker was killed" in errors[0]
    assert "Traceback" not in said
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in own_files(tmp_path / "whole"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
