"""One command in a process of its own, with limits on time and memory, and how it ended."""

import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

SECONDS = 60.0  # of the processor: a busy machine makes no hang
WAIT_S = 600.0  # for a command that neither works nor ends
BYTES = 4 << 30
ALLOWED = (0, 1, 2)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a command ended.

    Attributes
    ----------
    fault : str
        Empty where it ended well; else "traceback", "unforeseen" (caught by the last layer
        alone), "hang", "memory", "exit code", "silent".
    code : int
    seconds : float
        Of the processor, in commands.
    words : str
        The end of what it printed.
    """

    fault: str
    code: int
    seconds: float
    words: str


def run(words: Sequence[str], folder: Path) -> Outcome:
    """Run `flawforge` with these words in a folder; the modules loaded here are there already."""
    with tempfile.TemporaryFile() as said:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        process = started(words, folder, said.fileno())
        process.join(WAIT_S)
        hung = process.is_alive()
        if hung:
            process.kill()
            process.join()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        said.seek(0)
        printed = said.read().decode("utf-8", "replace")
    code = process.exitcode if process.exitcode is not None else -1
    fault = ""
    if hung or code == -signal.SIGXCPU:
        fault = "hang"
    elif "MemoryError" in printed or "Cannot allocate memory" in printed:
        fault = "memory"
    elif "Traceback (most recent call last)" in printed:
        fault = "traceback"
    elif "an error of ours" in printed:
        fault = "unforeseen"
    elif code not in ALLOWED:
        fault = "exit code"
    elif code == 2 and len([line for line in printed.splitlines() if line.strip()]) < 1:
        fault = "silent"
    return Outcome(fault=fault, code=code, seconds=seconds, words=printed[-600:])


def started(words: Sequence[str], folder: Path, said: int) -> multiprocessing.process.BaseProcess:
    """Start `flawforge` in a process group of its own; what it prints goes into a file."""
    context = multiprocessing.get_context("fork")
    process = context.Process(target=_child, args=(list(words), folder, said))
    process.start()
    return process


def _child(words: list[str], folder: Path, said: int) -> None:
    os.setsid()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for stream in (1, 2):
        os.dup2(said, stream)
    sys.stdout = os.fdopen(1, "w", closefd=False)
    sys.stderr = os.fdopen(2, "w", closefd=False)
    used = _address_space()
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (int(SECONDS), int(SECONDS) + 5))
    os.chdir(folder)
    from flawforge.cli import main

    code = 70
    try:
        code = main(words)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _address_space() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmSize:"):
            return int(line.split()[1]) * 1024
    return 0
