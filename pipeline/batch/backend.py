"""Where shards are made: processes here, or the workers of a Dask scheduler.

Only this module uses joblib. Processes beside this one are forked from it where that is safe;
elsewhere joblib's loky starts them anew, and this module imports late, so that they start while the
rest is loaded.
"""

import ctypes
import importlib
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from queue import SimpleQueue
from threading import Lock
from typing import Any, Final, Protocol

from pipeline.batch.forked import forkable, forked

QUEUED: Final = 1024  # shards that wait at a Dask scheduler
IDLE_S: Final = 300.0  # after which a process that has nothing to do ends
M_TRIM_THRESHOLD, M_MMAP_MAX = -1, -4  # of glibc's malloc.h
KEPT_BYTES: Final = 2**31 - 1
THREADS: Final = dict.fromkeys(  # a job is a core: libraries start no threads of their own
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)

Task = Callable[..., Any]
Arguments = tuple[Any, ...]


def one_thread_each() -> None:
    """Keep libraries that are not loaded yet from starting threads, unless the user set them."""
    for name, threads in THREADS.items():
        os.environ.setdefault(name, threads)


class Pool(Protocol):
    """Processes that run a task on arguments given by their number."""

    def submit(self, number: int) -> "Future[Any]":
        """Run the task on these arguments; a broken pool raises RuntimeError."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Backend:
    """Where shards are made: `jobs` processes here, or the workers of a Dask scheduler.

    The calling process is one of the jobs and works as the others.
    """

    jobs: int = 1
    scheduler: str | None = None

    @contextmanager
    def started(self) -> Iterator["Backend"]:
        """Start processes that can't be forked: they load modules while the recipe is read.

        They end with the context: all their results are written.
        """
        if self.jobs == 1 or self.scheduler:
            yield self
            return
        one_thread_each()
        if forkable():
            yield self
            return
        others = self._fresh()
        others.submit(os.getpid)
        try:
            yield self
        finally:
            others.shutdown(kill_workers=True)

    def forks(self, tasks: int) -> bool:
        """Whether so many tasks would be run by forks of this process, which share its memory."""
        return min(self.jobs, tasks) > 1 and not self.scheduler and forkable()

    def results(self, task: Task, each: Sequence[Arguments]) -> Iterator[Any]:
        """Run a task on each argument; yield results in the order of completion."""
        if self.scheduler:
            return self._by_dask(task, each)
        if min(self.jobs, len(each)) > 1:
            return self._together(task, each)
        return (_worked(task, one) for one in each)

    def _by_dask(self, task: Task, each: Sequence[Arguments]) -> Iterator[Any]:
        import joblib

        parallel = joblib.Parallel(
            n_jobs=-1,
            return_as="generator_unordered",
            batch_size=1,
            # enough for workers that join later, yet not all of a million scans at once
            pre_dispatch=QUEUED,
        )
        results: Iterator[Any] = parallel(joblib.delayed(_worked)(task, one) for one in each)
        return results

    def _together(self, task: Task, each: Sequence[Arguments]) -> Iterator[Any]:
        """Work here and in the other processes; whoever is free takes the next arguments."""
        left, turn = iter(range(len(each))), Lock()
        done: SimpleQueue[Future[Any]] = SimpleQueue()
        sent = got = 0

        def take() -> int | None:
            with turn:
                return next(left, None)

        def send(others: Pool) -> None:
            nonlocal sent
            with turn:
                number = next(left, None)
                if number is None:
                    return
                sent += 1
            try:
                future = others.submit(number)
            except RuntimeError as error:  # broken, or shut down meanwhile
                future = Future()
                future.set_exception(error)
                done.put(future)
            else:
                future.add_done_callback(lambda future: receive(others, future))

        def receive(others: Pool, future: Future[Any]) -> None:
            if not future.cancelled() and future.exception() is None:
                send(others)
            done.put(future)

        with self._others(min(self.jobs, len(each)) - 1, task, each) as others:
            for _ in range(self.jobs - 1):
                send(others)
            while (number := take()) is not None:
                yield _worked(task, each[number])
                while not done.empty():
                    got += 1
                    yield done.get().result()
            while got < sent:
                got += 1
                yield done.get().result()

    @contextmanager
    def _others(self, count: int, task: Task, each: Sequence[Arguments]) -> Iterator[Pool]:
        """Provide the processes beside this one; where the context fails, they are killed."""
        if forkable():
            with forked(count, _worked, [(task, one) for one in each]) as pool:
                yield pool
            return
        others, whole = self._fresh(), False
        try:
            yield _Fresh(others, task, each)
            whole = True
        finally:
            if not whole:
                others.shutdown(kill_workers=True)

    def _fresh(self) -> Any:
        """Return loky's processes beside this one, the same every time."""
        from joblib.externals.loky import get_reusable_executor

        return get_reusable_executor(
            self.jobs - 1, timeout=IDLE_S, env=THREADS, initializer=_begin
        )

    @contextmanager
    def chosen(self, versions: Mapping[str, str]) -> Iterator[Any]:
        """Connect to Dask's scheduler, where there is one, for a context; yields its client.

        Its workers must have these versions.

        Raises
        ------
        RecipeError
            Where the scheduler or its workers can't be used, or a worker died.
        """
        from files.errors import RecipeError

        if self.scheduler:
            import joblib

            from pipeline.batch.cluster import cluster

            with (
                cluster(self.scheduler, versions) as client,
                joblib.parallel_config("dask", client=client),
            ):
                yield client
            return
        try:
            yield None
        except BrokenExecutor:
            raise RecipeError(
                "a worker was killed, perhaps for lack of memory",
                where="--jobs",
                value=self.jobs,
                allowed="fewer jobs; the same command continues from the finished shards",
            ) from None


class _Fresh:
    """Loky's processes as a pool: task and arguments are sent."""

    def __init__(self, executor: Any, task: Task, each: Sequence[Arguments]) -> None:
        self._executor, self._task, self._each = executor, task, each

    def submit(self, number: int) -> "Future[Any]":
        """Run the task on the arguments of this number."""
        future: Future[Any] = self._executor.submit(_worked, self._task, self._each[number])
        return future


def _begin() -> None:
    """Make a process ready: load what scans need, and let it keep as much memory as it needs.

    Loky takes a process for leaking, and ends it, once it has 300 MB more than after its first
    task. Kept parts and a large scan's arrays are more than that; a test holds that memory doesn't
    grow with the number of scans.
    """
    from joblib.externals.loky import process_executor

    importlib.import_module("pipeline.batch.work")
    process_executor._MAX_MEMORY_LEAK_SIZE = sys.maxsize


def _worked(task: Task, arguments: Arguments) -> Any:
    """Run a task in a process that has one thread and keeps its memory."""
    one_thread()
    keep_memory()
    return task(*arguments)


@cache
def one_thread() -> None:
    """Hold booleans and trees of this process to one thread: a job is a core, and can be forked.

    manifold3d and Embree start as many threads as the process may use cores, at their first
    boolean and tree, and have no switch for it; so these are made on a single core.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    import numpy as np
    from manifold3d import Manifold

    from sensors.casting.scene import Scene

    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        ball = Manifold.sphere(1.0, 32)
        (ball - ball.translate((0.5, 0.5, 0.5))).status()
        _ = Scene(np.eye(3), np.array([[0, 1, 2]])).tree
    finally:
        os.sched_setaffinity(0, cores)


@cache
def keep_memory() -> None:
    """Let this process keep the memory of its last scan for the next one, where glibc is in use.

    A large array's memory would go back to the system, which clears it anew for the next array: a
    tenth of a large scan's time.
    """
    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(M_MMAP_MAX, 0)
        mallopt(M_TRIM_THRESHOLD, KEPT_BYTES)
