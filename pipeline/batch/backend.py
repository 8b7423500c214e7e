"""Where shards are made: processes here, or the workers of a Dask scheduler.

Only this module uses joblib. The module imports late, so that processes start while the rest is
loaded.
"""

import importlib
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from queue import SimpleQueue
from threading import Lock
from typing import Any, Final

QUEUED: Final = 1024  # shards that wait at a Dask scheduler
IDLE_S: Final = 300.0  # after which a process that has nothing to do ends
THREADS: Final = dict.fromkeys(  # a job is a core: libraries start no threads of their own
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)

Task = Callable[..., Any]
Arguments = tuple[Any, ...]


def one_thread_each() -> None:
    """Keep libraries that are not loaded yet from starting threads, unless the user set them."""
    for name, threads in THREADS.items():
        os.environ.setdefault(name, threads)


@dataclass(frozen=True, kw_only=True, slots=True)
class Backend:
    """Where shards are made: `jobs` processes here, or the workers of a Dask scheduler.

    The calling process is one of the jobs and works as the others.
    """

    jobs: int = 1
    scheduler: str | None = None

    @contextmanager
    def started(self) -> Iterator["Backend"]:
        """Start the other processes, which load modules while the recipe is read.

        They end with the context: all their results are written.
        """
        if self.jobs == 1 or self.scheduler:
            yield self
            return
        one_thread_each()
        others = self._others()
        others.submit(os.getpid)
        try:
            yield self
        finally:
            others.shutdown(kill_workers=True)

    def results(self, task: Task, each: Iterable[Arguments]) -> Iterator[Any]:
        """Run a task on each argument; yield results in the order of completion."""
        if self.scheduler:
            return self._by_dask(task, each)
        if self.jobs > 1:
            return self._together(task, each)
        return (_worked(task, one) for one in each)

    def _by_dask(self, task: Task, each: Iterable[Arguments]) -> Iterator[Any]:
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

    def _together(self, task: Task, each: Iterable[Arguments]) -> Iterator[Any]:
        """Work here and in the other processes; whoever is free takes the next arguments."""
        others, left, turn = self._others(), iter(each), Lock()
        done: SimpleQueue[Future[Any]] = SimpleQueue()
        sent = got = 0

        def take() -> Arguments | None:
            with turn:
                return next(left, None)

        def send() -> None:
            nonlocal sent
            with turn:
                one = next(left, None)
                if one is None:
                    return
                sent += 1
            try:
                others.submit(_worked, task, one).add_done_callback(receive)
            except RuntimeError as error:  # broken, or shut down meanwhile
                lost: Future[Any] = Future()
                lost.set_exception(error)
                done.put(lost)

        def receive(future: Future[Any]) -> None:
            if not future.cancelled() and future.exception() is None:
                send()
            done.put(future)

        whole = False
        try:
            for _ in range(self.jobs - 1):
                send()
            while (one := take()) is not None:
                yield _worked(task, one)
                while not done.empty():
                    got += 1
                    yield done.get().result()
            while got < sent:
                got += 1
                yield done.get().result()
            whole = True
        finally:
            if not whole:
                others.shutdown(kill_workers=True)

    def _others(self) -> Any:
        """Return the processes beside this one, the same every time."""
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
    """Run a task in a process that has one thread."""
    one_thread()
    return task(*arguments)


@cache
def one_thread() -> None:
    """Hold the booleans of this process to one thread: a job is a core.

    manifold3d starts as many threads as the process may use cores at its first boolean, and has
    no switch for it; so that one is done on a single core.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    from manifold3d import Manifold

    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        ball = Manifold.sphere(1.0, 32)
        (ball - ball.translate((0.5, 0.5, 0.5))).status()
    finally:
        os.sched_setaffinity(0, cores)
