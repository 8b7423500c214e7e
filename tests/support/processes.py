"""Processes that tests start, and their logs."""

import subprocess
import time
from pathlib import Path

HOME = Path(__file__).resolve().parents[2]


def wait_for(log: Path, words: str, process: subprocess.Popen[bytes]) -> None:
    """Wait until a process has written the words to its log; it fails if the process ends."""
    deadline = time.monotonic() + 120
    while words not in log.read_text():
        assert process.poll() is None, log.read_text()
        assert time.monotonic() < deadline, log.read_text()
        time.sleep(0.05)
