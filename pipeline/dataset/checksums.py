"""Checksums of every file of a dataset, in the form that `sha256sum --check` reads."""

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from files.budget import regular
from files.whole_file import write_whole
from pipeline.dataset.shards import file_sha256

NAME: Final = "checksums.sha256"
OWN: Final = (
    "shard-*.h5", "manifest.*", "flaws.*", "dataset.json", "croissant.json", "README.md",
    ".flawforge/*.json",
)  # fmt: skip
"""Patterns of the files that a dataset consists of; what else lies in its folder is the user's."""
_LINE = re.compile(r"([0-9a-f]{64})  (\S.*)")
_ROOT = re.compile(r"# root ([0-9a-f]{64})")


@dataclass(frozen=True, kw_only=True, slots=True)
class Checksums:
    """SHA-256 of each file by its name, and of the list itself, the root."""

    files: Mapping[str, str]
    root: str


def own_files(folder: Path) -> list[str]:
    """Return the names of a dataset's files, in order."""
    found = {path for pattern in OWN for path in folder.glob(pattern) if path.is_file()}
    return sorted(path.relative_to(folder).as_posix() for path in found)


def write_checksums(folder: Path, known: Mapping[str, str]) -> Checksums:
    """Write the list of a folder's files and of those `known` by name, which are not read."""
    names = sorted({*own_files(folder), *known})
    files = {name: known.get(name) or file_sha256(folder / name) for name in names}
    body = "".join(f"{digest}  {name}\n" for name, digest in files.items())
    root = hashlib.sha256(body.encode()).hexdigest()
    write_whole(folder / NAME, f"{body}# root {root}\n")
    return Checksums(files=files, root=root)


def read_checksums(folder: Path) -> Checksums | None:
    """Return the list, None without the file.

    Raises
    ------
    ValueError
        Where the list itself is damaged.
    """
    if not (folder / NAME).exists():
        return None
    regular(folder / NAME)
    blob = (folder / NAME).read_bytes()
    body, mark, last = blob.rpartition(b"# root ")
    root = _ROOT.fullmatch((mark + last).decode("ascii", "replace").rstrip("\n"))
    if root is None or not last.endswith(b"\n") or last.count(b"\n") != 1:
        raise ValueError("its last line isn't a root checksum")
    if hashlib.sha256(body).hexdigest() != root.group(1):
        raise ValueError("its root checksum isn't that of its lines")
    files: dict[str, str] = {}
    for line in body.decode("utf-8").splitlines():
        found = _LINE.fullmatch(line)
        if found is None:
            raise ValueError(f"{line!r} isn't a checksum and a name")
        files[found.group(2)] = found.group(1)
    return Checksums(files=files, root=root.group(1))
