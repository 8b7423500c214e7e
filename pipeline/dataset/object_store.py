"""A dataset in an object store: whole objects alone, each under its final name.

An object appears whole or not at all, so an upload does what renaming does in a folder. Shards are
made in a folder of this machine and leave it one by one.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from files.errors import RecipeError
from files.place import is_local, names, place, put, reached

HIDDEN: Final = ".flawforge"  # of the journals, as in a folder
MARK: Final = f"{HIDDEN}/run.json"


@contextmanager
def staged(out: str | Path) -> Iterator[tuple[Path | None, Path]]:
    """Yield the store of a dataset, None for a folder, and the folder in which it is made.

    Raises
    ------
    RecipeError
        Where the store can't be used, or the package for it isn't installed.
    """
    at = place(out)
    if is_local(at):
        yield None, at
        return
    with tempfile.TemporaryDirectory(prefix="flawforge-") as folder:
        yield at, Path(folder) / "dataset"


def claim(store: Path, hidden: Path) -> None:
    """Take a prefix for the dataset of a run, and an earlier run's journals into its folder.

    Where the store has conditional writes, only one of several runs can take an empty prefix.

    Raises
    ------
    RecipeError
        Where it holds something else.
    """
    mine, found = (hidden / "run.json").read_text(), names(store)
    if MARK not in found:
        if found:
            raise RecipeError(
                "the prefix isn't empty and holds no dataset", where=store,
                allowed="an empty prefix",
            )  # fmt: skip
        with suppress(FileExistsError):
            put(hidden / "run.json", store / MARK, new=True)
    with reached(store):
        theirs = (store / MARK).read_text()
    if theirs != mine:
        raise RecipeError(
            "the prefix holds the dataset of another recipe or of other versions", where=store,
            allowed="an empty prefix, or the recipe as it was",
        )  # fmt: skip
    for name in found:
        folder, _, file = name.rpartition("/")
        if folder == HIDDEN and file.startswith("shard-"):
            with reached(store):
                (hidden / file).write_bytes((store / name).read_bytes())


def publish(store: Path, out: Path) -> None:
    """Upload what describes a whole dataset; dataset.json comes last."""
    files = [path for path in out.iterdir() if path.is_file()]
    for path in sorted(files, key=lambda path: (path.name == "dataset.json", path.name)):
        put(path, store / path.name)
