"""Work on the cases of a set in several processes."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any, Final

ONE_CORE: Final = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


def in_processes(
    work: Callable[..., None], calls: Iterable[tuple[Any, ...]], jobs: int
) -> Iterator[tuple[Any, ...]]:
    """Call `work` with each of `calls`; yield them as they are done.

    A job is a core: each process starts afresh with one thread for its linear algebra.
    """
    os.environ.update(ONE_CORE)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(work, *call): call for call in calls}
        for ready in as_completed(waiting):
            ready.result()
            yield waiting[ready]
