"""The dataset's folder: one run at a time, one recipe, the same after a crash."""

import fcntl
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.util import register_after_fork
from pathlib import Path
from typing import Any

from files.errors import RecipeError
from files.whole_file import write_whole


@contextmanager
def held(out: Path, fingerprint: str) -> Iterator[Path]:
    """Hold a dataset's folder for one run; yields the folder of its journals.

    The operating system holds the lock and releases it at the end of the process. A run that is
    refused before its first shard leaves the folder unchanged.

    Raises
    ------
    RecipeError
        Where another run holds it, or it holds something else than this recipe's dataset.
    """
    hidden = out / ".flawforge"
    if out.exists() and not out.is_dir():
        raise RecipeError("--out is a file", where=out, allowed="a folder")
    if out.is_dir() and any(out.iterdir()) and not hidden.is_dir():
        raise RecipeError(
            "the folder isn't empty and holds no dataset", where=out, allowed="an empty folder"
        )
    new = [path for path in (hidden, out, *out.parents) if not path.exists()]
    try:
        hidden.mkdir(parents=True, exist_ok=True)
        lock = (hidden / "lock").open("w")
    except OSError as error:
        raise RecipeError(f"can't be written ({error.strerror})", where=out) from None
    register_after_fork(lock, type(lock).close)  # a fork of this process would hold the lock, too
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RecipeError("another run is writing into this folder", where=out) from None
        mark = hidden / "run.json"
        mine = {"fingerprint": fingerprint}
        known = _read(mark)
        if known is not None and known != mine:
            raise RecipeError(
                "the folder holds the dataset of another recipe or of other versions",
                where=out,
                allowed="an empty folder, or the recipe as it was",
            )
        write_whole(mark, json.dumps(mine))
        drop_leftovers(out)
        try:
            yield hidden
        except ValueError:
            if hidden in new and not any(out.glob("shard-*")):
                shutil.rmtree(hidden)
                for folder in new[1:]:
                    folder.rmdir()
            raise


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


def drop_leftovers(out: Path) -> None:
    """Remove partial files of killed workers."""
    for leftover in (*out.glob(".*.part*"), *(out / ".flawforge").glob(".*")):
        leftover.unlink(missing_ok=True)


def drop_parts(folder: Path) -> None:
    """Remove the stored parts of a finished dataset or of a stopped run."""
    shutil.rmtree(folder, ignore_errors=True)
