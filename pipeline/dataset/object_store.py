"""A dataset in an object store: whole objects alone, each under its final name.

Only this module uses fsspec. An object appears whole or not at all, so an upload does what
renaming does in a folder. Shards are made in a folder of this machine and leave it one by one.
"""

import hashlib
import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from files.errors import RecipeError

HIDDEN: Final = ".flawforge"  # of the journals, as in a folder
BLOCK: Final = 1 << 22  # bytes of an object that are read at a time


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectStore:
    """A prefix of an object store, like s3://bucket/dataset.

    Parameters
    ----------
    url
        The prefix, without a slash at its end.
    """

    url: str

    def read(self, name: str) -> bytes | None:
        """Return an object's content; None where there is no such object."""
        files, root = _opened(self.url)
        try:
            content: bytes = files.cat_file(f"{root}/{name}")
        except FileNotFoundError:
            return None
        return content

    def sha256(self, name: str) -> str | None:
        """Return an object's SHA-256, from all its bytes; None where there is no such object."""
        files, root = _opened(self.url)
        digest = hashlib.sha256()
        try:
            with files.open(f"{root}/{name}", "rb", block_size=BLOCK) as file:
                while block := file.read(BLOCK):
                    digest.update(block)
        except FileNotFoundError:
            return None
        return digest.hexdigest()

    def put(self, path: Path, name: str) -> None:
        """Upload a file; readers see the object before or the whole new one."""
        files, root = _opened(self.url)
        files.put_file(str(path), f"{root}/{name}")

    def names(self) -> list[str]:
        """Return the names of all objects under the prefix."""
        files, root = _opened(self.url)
        return [name.removeprefix(f"{root}/") for name in files.find(root)]


@lru_cache(maxsize=4)
def _opened(url: str) -> tuple[Any, str]:
    """Return fsspec's file system of a prefix, and the prefix by its reckoning."""
    from fsspec.core import url_to_fs

    files, root = url_to_fs(url, use_listings_cache=False)
    return files, root.rstrip("/")


def is_url(place: str) -> bool:
    """Return whether a dataset's place is a prefix of an object store, not a folder."""
    return "://" in place


@contextmanager
def staged(url: str) -> Iterator[tuple[ObjectStore, Path]]:
    """Yield a store and the folder of this machine in which its dataset is made.

    Raises
    ------
    RecipeError
        Where the store can't be reached, or the package for it isn't installed.
    """
    store = ObjectStore(url=url.rstrip("/"))
    try:
        store.names()
    except ImportError as error:
        raise RecipeError(
            f"a package for this store isn't installed ({error})", where="--out", value=url,
            allowed="for s3:// it comes with: pip install 'flawforge[s3]'",
        ) from None  # fmt: skip
    except Exception as error:  # each store's library has errors of its own
        why = str(error).strip().splitlines() or [type(error).__name__]
        raise RecipeError(
            f"the object store can't be read ({why[0]})", where="--out", value=url,
            allowed="a bucket that exists, with the keys of your environment",
        ) from None  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="flawforge-") as folder:
        yield store, Path(folder) / "dataset"


def claim(store: ObjectStore, hidden: Path, fingerprint: str) -> None:
    """Take a prefix for a recipe's dataset, and the journals of an earlier run into a folder.

    Raises
    ------
    RecipeError
        Where it holds something else.
    """
    names = store.names()
    mine = json.dumps({"fingerprint": fingerprint})
    mark = store.read(f"{HIDDEN}/run.json")
    if mark is None and names:
        raise RecipeError(
            "the prefix isn't empty and holds no dataset", where="--out", value=store.url,
            allowed="an empty prefix",
        )  # fmt: skip
    if mark is not None and mark.decode() != mine:
        raise RecipeError(
            "the prefix holds the dataset of another recipe or of other versions",
            where="--out", value=store.url, allowed="an empty prefix, or the recipe as it was",
        )  # fmt: skip
    if mark is None:
        store.put(hidden / "run.json", f"{HIDDEN}/run.json")
    for name in names:
        folder, _, file = name.rpartition("/")
        if folder == HIDDEN and file.startswith("shard-"):
            (hidden / file).write_bytes(store.read(name) or b"")


def publish(store: ObjectStore, out: Path) -> None:
    """Upload what describes a whole dataset; dataset.json comes last."""
    files = [path for path in out.iterdir() if path.is_file()]
    for path in sorted(files, key=lambda path: (path.name == "dataset.json", path.name)):
        store.put(path, path.name)
