"""Forked processes: only where that is safe, and never longer than their parent."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from pipeline.batch.backend import Backend
from pipeline.batch.forked import forkable

HOME = Path(__file__).resolve().parents[3]
ALONE = """
import os, sys
from pathlib import Path
from pipeline.batch.backend import Backend, one_thread_each
one_thread_each()
from pipeline.batch.forked import forkable
from files.errors import RecipeError
def here(number):
    return os.getppid() if number else 0
def kill(number):
    os.kill(os.getpid(), 9)
def sleep(number):
    import time
    print(os.getpid(), flush=True)
    time.sleep(60)
"""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="no forks here")


def said(code: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", ALONE + code],
        cwd=HOME, check=True, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip


def test_a_process_with_a_second_thread_is_not_forked():
    wait = threading.Event()
    thread = threading.Thread(target=wait.wait)
    thread.start()
    try:
        assert not forkable()
        assert not Backend(jobs=2).forks(2)
    finally:
        wait.set()
        thread.join()


def test_batch_and_parts_start_no_thread():
    code = """
from pipeline.batch.backend import one_thread
import pipeline.batch.run
from pipeline.parts import builtin
from sensors.casting.scene import Scene
one_thread()
part = builtin.build("bearing_cap", 80.0)
Scene(part.vertices_mm, part.faces).tree
print(forkable())
"""
    assert said(code) == "True"


def test_forks_share_what_is_there_and_one_fork_follows_another():
    code = """
for _ in range(2):
    numbers = [(number,) for number in range(6)]
    print(set(Backend(jobs=3).results(here, numbers)) <= {0, os.getpid(), os.getppid()}, forkable())
"""
    assert set(said(code).split()) == {"True"}


def test_a_killed_fork_is_an_error_of_the_user():
    code = """
def task(number):
    if os.getpid() != first:
        kill(number)
first = os.getpid()
try:
    with Backend(jobs=2).chosen({}):
        list(Backend(jobs=2).results(task, [(k,) for k in range(4)]))
except RecipeError as error:
    print("killed" in str(error), forkable())
"""
    assert said(code) == "True True"


def test_forks_end_with_their_parent_and_hold_no_lock(tmp_path):
    code = f"""
from pipeline.dataset.folder import held
with held(Path({str(tmp_path / "out")!r}), "mine"):
    list(Backend(jobs=2).results(sleep, [(0,), (1,)]))
"""
    process = subprocess.Popen(
        [sys.executable, "-c", ALONE + code], cwd=HOME, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    pids = {int(process.stdout.readline()) for _ in range(2)}
    (fork,) = pids - {process.pid}
    locks = [os.readlink(f"/proc/{fork}/fd/{fd}") for fd in os.listdir(f"/proc/{fork}/fd")]
    assert not any(path.endswith("lock") for path in locks)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    end = time.monotonic() + 10.0
    while Path(f"/proc/{fork}").exists() and _state(fork) != "Z":
        assert time.monotonic() < end
        time.sleep(0.01)


def _state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return "Z"


def test_what_fails_here_kills_the_forks():
    code = """
import time
begin = time.monotonic()
def task(number):
    if os.getpid() == first:
        raise ValueError("here")
    time.sleep(60)
first = os.getpid()
try:
    list(Backend(jobs=2).results(task, [(k,) for k in range(4)]))
except ValueError:
    print(time.monotonic() - begin < 30)
"""
    assert said(code) == "True"
