"""Where shards are made: processes here, or the workers of a Dask scheduler.

The one place that knows joblib. It loads nothing else of ours until it must, so that processes
start while the rest is loaded.
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import joblib
from joblib.externals.loky import process_executor

QUEUED: Final = 1024  # shards that wait at a Dask scheduler


@dataclass(frozen=True, kw_only=True, slots=True)
class Backend:
    """Where shards are made: `jobs` processes here, or the workers of a Dask scheduler."""

    jobs: int = 1
    scheduler: str | None = None

    @contextmanager
    def started(self) -> Iterator["Backend"]:
        """Have the processes begin to load what scans need, while the recipe is read here."""
        loading: Iterable[Any] = ()
        with self._local():
            if self.jobs > 1 and not self.scheduler:
                loading = self.results(_load, (() for _ in range(self.jobs)))
        try:
            yield self
        finally:
            for _ in loading:
                pass

    def results(
        self, task: Callable[..., Any], each: Iterable[tuple[Any, ...]]
    ) -> Iterable[Any]:
        """Run a task on each of some arguments; give results as they come, in any order."""
        parallel = joblib.Parallel(
            n_jobs=-1 if self.scheduler else self.jobs,
            return_as="generator_unordered",
            batch_size=1,
            # enough for workers that join later, yet not all of a million scans at once
            pre_dispatch=QUEUED if self.scheduler else "2*n_jobs",
        )
        results: Iterable[Any] = parallel(joblib.delayed(_worked)(task, one) for one in each)
        return results

    def _local(self) -> AbstractContextManager[Any]:
        if self.jobs > 1:
            # each worker is one thread: cores are shared out among processes
            context: AbstractContextManager[Any] = joblib.parallel_config(
                "loky", inner_max_num_threads=1
            )
            return context
        return nullcontext()

    @contextmanager
    def chosen(self) -> Iterator[Any]:
        """Make joblib use this backend within a context; yields Dask's client, or None.

        Raises
        ------
        RecipeError
            Where the scheduler or its workers can't be used, or a worker died.
        """
        from sensors.typed_yaml import RecipeError

        if self.scheduler:
            from pipeline.cluster import cluster

            with cluster(self.scheduler) as client, joblib.parallel_config("dask", client=client):
                yield client
        else:
            with self._local():
                try:
                    yield None
                except process_executor.TerminatedWorkerError:
                    raise RecipeError(
                        "a worker was killed; memory may be short",
                        where="--jobs",
                        value=self.jobs,
                        allowed="fewer jobs; the same command goes on from what is finished",
                    ) from None


def _worked(task: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Run a task in a worker, which has one thread and may keep as much memory as it needs.

    Loky takes a worker for leaking, and ends it, once it has 300 MB more than after its first
    task. Kept parts and a large scan's arrays are more than that; a test holds that memory doesn't
    grow with the number of scans.
    """
    process_executor._MAX_MEMORY_LEAK_SIZE = sys.maxsize
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


def _load() -> None:
    """Load what a worker needs for scans."""
    import pipeline.work  # noqa: F401
