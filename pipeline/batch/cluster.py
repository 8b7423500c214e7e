"""The workers of a Dask scheduler: connection, and a check for equal bytes."""

import logging
import re
import socket
from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from files.errors import RecipeError
from pipeline.dataset.manifest import versions

ANSWER_S: Final = 10.0  # how long the scheduler may take to answer
GOES_ON: Final = "the same command continues from the finished shards"
WORKERS_S: Final = 60.0  # how long the first worker may take to join it


@contextmanager
def cluster(address: str, wanted: Mapping[str, str]) -> Iterator[Any]:
    """Connect to a scheduler and check its workers; yields distributed's client.

    Parameters
    ----------
    address
        Of the scheduler.
    wanted
        Versions that every worker must have, see `pipeline.dataset.manifest.versions`.

    Raises
    ------
    RecipeError
        Where distributed isn't installed, nobody answers, no worker joins, a worker has other
        versions than this machine; or later, where the scheduler is lost or workers die of a task.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm.core import CommClosedError
    except ImportError:
        raise RecipeError(
            "Dask isn't installed here",
            where="--backend",
            value="dask",
            allowed="it comes with: pip install 'flawforge[dask]'",
        ) from None
    try:
        # asked for by hand first: distributed itself goes on trying and leaves threads behind
        place = re.fullmatch(r"(?:tcp|tls|ws|wss)://\[?([^/\]]+)\]?:(\d+)", address)
        if place is None:
            raise OSError("not an address")
        socket.create_connection((place[1], int(place[2])), ANSWER_S).close()
        connect: Any = Client  # its types are not complete
        client = connect(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, OverflowError) as error:
        raise RecipeError(
            f"no Dask scheduler answers ({_short(error)})",
            where="--scheduler",
            value=address,
            allowed="the address that 'dask scheduler' prints, like tcp://host:8786",
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise RecipeError(
                "the Dask scheduler has no workers",
                where="--scheduler",
                value=address,
                allowed=f"start some with: dask worker {address} --nthreads 1",
            ) from None
        _ask(client, _differences, wanted, "can't give the same bytes")
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # the error says it
        try:
            yield client
        except (CancelledError, CommClosedError, OSError) as error:
            lost = isinstance(error, CancelledError | CommClosedError)
            if not lost and "trying to connect" not in str(error):  # Dask has no type for it
                raise
            raise RecipeError(
                "the Dask scheduler was lost", where="--scheduler", value=address,
                allowed=f"a scheduler that runs; {GOES_ON}",
            ) from None  # fmt: skip
        except KilledWorker:
            raise RecipeError(
                "several workers died of one shard, perhaps for lack of memory",
                where="--scheduler", value=address,
                allowed=f"workers with a larger --memory-limit; {GOES_ON}",
            ) from None  # fmt: skip


def check_folder(client: Any, folder: Path) -> None:
    """Check that all workers see a folder of this machine under the same path.

    Raises
    ------
    RecipeError
        Where one doesn't.
    """
    _ask(client, _missing, str(folder), "doesn't share the dataset's folder")


def _ask(client: Any, question: Any, about: Any, wrong: str) -> None:
    """Put a question to every worker; an answer of words is what is wrong."""
    for worker, answer in client.run(question, about, on_error="return").items():
        if answer:
            raise RecipeError(
                f"worker {worker} {wrong}: {_short(answer)}",
                where="--scheduler",
                allowed="workers with the same environment that see the same folders",
            )


def _differences(wanted: Mapping[str, str]) -> str:
    try:
        here = versions(wanted.keys() - {*versions()})
    except ImportError as error:  # PackageNotFoundError
        return f"without {error.name}"
    return ", ".join(
        f"{name} {here[name]} instead of {version}"
        for name, version in wanted.items()
        if here[name] != version
    )


def _missing(folder: str) -> str:
    return "" if Path(folder).is_dir() else f"no folder {folder}"


def _short(error: Any) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
