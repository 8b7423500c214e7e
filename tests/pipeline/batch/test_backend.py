"""A job is a core: booleans in a worker start no threads of their own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[3]
THREADS = """
from pathlib import Path
from manifold3d import Manifold
def threads():
    return len(list(Path("/proc/self/task").iterdir()))
def boolean():
    ball = Manifold.sphere(1.0, 256)
    (ball - ball.translate((0.5, 0.5, 0.5))).status()
"""


def said(code: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", THREADS + code],
        cwd=HOME, check=True, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip


@pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2,
    reason="one core only, or a system that doesn't say",
)
def test_booleans_of_a_worker_have_one_thread():
    worker = (
        "from pipeline.batch.backend import one_thread\nimport os\n"
        "cores = os.sched_getaffinity(0)\none_thread()\n"
        "before = threads()\nboolean()\n"
        "print(threads() - before, os.sched_getaffinity(0) == cores)"
    )
    assert said(worker) == "0 True"
    assert int(said("before = threads()\nboolean()\nprint(threads() - before)")) > 0
