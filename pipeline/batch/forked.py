"""Processes forked from this one: what is loaded, compiled and built here they have already.

A fork copies the calling thread alone; locks that other threads hold would stay locked in the copy.
So a process is forked only while it has one thread, native ones included, and on Linux, which
lists them. The pool forks all its processes at its first task, before it starts threads of its own.
"""

import ctypes
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any, Final

THREADS_HERE: Final = "/proc/self/task"
ENDS_S: Final = 0.1  # in which a thread that was joined ends
DIES_WITH_PARENT: Final = 1  # Linux's PR_SET_PDEATHSIG
LEFT_TO_THE_PARENT: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)

_shared: tuple[Callable[..., Any], Sequence[tuple[Any, ...]]] | None = None


def forkable() -> bool:
    """Whether this process can be forked safely: it has one thread, and Linux says so.

    Python knows its own threads; one that it joined may take a moment to end.
    """
    if sys.platform != "linux":
        return False
    end = time.monotonic() + ENDS_S
    while threading.active_count() == 1:
        try:
            if len(os.listdir(THREADS_HERE)) == 1:
                return True
        except OSError:
            return False
        if time.monotonic() > end:
            return False
        time.sleep(ENDS_S / 100)
    return False


class Forked:
    """A pool of forked processes that run one task on some of its arguments, given by number.

    Task and arguments are inherited, too: only numbers and results are sent.
    """

    def __init__(self, pool: ProcessPoolExecutor) -> None:
        self._pool = pool

    def submit(self, number: int) -> Future[Any]:
        """Run the task on the arguments of this number.

        Raises
        ------
        RuntimeError
            Where the pool is broken or shut down.
        """
        return self._pool.submit(_run, number)


@contextmanager
def forked(
    count: int, task: Callable[..., Any], each: Sequence[tuple[Any, ...]]
) -> Iterator[Forked]:
    """Fork `count` processes for a context; those that are at work when it is left are killed.

    Parameters
    ----------
    count
        Number of processes.
    task, each
        What they run, and all the arguments that it may be run on.
    """
    global _shared
    pool = ProcessPoolExecutor(
        count, mp_context=get_context("fork"), initializer=_begin, initargs=(os.getpid(),)
    )
    others = set(active_children())
    _shared = task, each
    # the copies' garbage collector leaves what is here alone: pages that it touches are copied
    gc.freeze()
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, LEFT_TO_THE_PARENT)
    try:
        pool.submit(os.getpid)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        gc.unfreeze()
        _shared = None
    mine = set(active_children()) - others
    whole = False
    try:
        yield Forked(pool)
        whole = True
    finally:
        if not whole:
            for process in mine:
                process.kill()
        pool.shutdown(wait=True, cancel_futures=True)


def _begin(parent: int) -> None:
    """Make a forked process ready: it ends with its parent, to whom signals are left."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all processes
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, LEFT_TO_THE_PARENT)
    ctypes.CDLL(None).prctl(DIES_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


def _run(number: int) -> Any:
    assert _shared is not None
    task, each = _shared
    return task(*each[number])
