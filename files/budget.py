"""Budgets: limits of inputs, checked before memory or time is spent."""

import os
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from files.errors import RecipeError

VARIABLE: Final = "FLAWFORGE_LIMITS"
LIMITS: Final[Mapping[str, float]] = {
    "readings": 1e8,  # of a file; 0.8 GB as float64, a scan of 8192 points and 12,000 profiles
    "bytes": 4e9,  # of a file as it lies on the disk
    "unpacked": 2e9,  # bytes, of an archive
    "triangles": 2e7,  # of a mesh: 1 GB
}
"""Limits by name; `FLAWFORGE_LIMITS=readings=4e8,unpacked=1e10` raises them."""


def limit(name: str) -> float:
    """Return a limit, as the environment or this file sets it.

    Raises
    ------
    RecipeError
        Where the environment variable is not of the form NAME=NUMBER,...
    """
    for pair in filter(None, os.environ.get(VARIABLE, "").split(",")):
        key, _, value = pair.partition("=")
        if key.strip() not in LIMITS:
            raise RecipeError(
                "unknown limit", where=VARIABLE, value=pair, allowed=", ".join(LIMITS)
            )
        if key.strip() == name:
            try:
                return float(value)
            except ValueError:
                raise RecipeError("isn't a number", where=VARIABLE, value=pair) from None
    return LIMITS[name]


def allow(name: str, amount: float, *, where: str | Path) -> None:
    """Refuse an input that announces more than its limit.

    Raises
    ------
    RecipeError
        Naming the limit and how to raise it.
    """
    most = limit(name)
    if not 0 <= amount <= most:
        raise RecipeError(
            f"announces {amount:.4g} {name}", where=where,
            allowed=f"{most:.4g} at most; {VARIABLE}={name}=NUMBER raises it",
        )  # fmt: skip


def regular(path: Path) -> None:
    """Refuse folders, pipes, devices and sockets, and files over the limit.

    Raises
    ------
    RecipeError
        Naming the case.
    """
    try:
        facts = path.stat()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a path"
        gone = isinstance(error, FileNotFoundError)
        said = "no such file" if gone else f"can't be read ({reason})"
        raise RecipeError(said, where=path) from None
    if not stat.S_ISREG(facts.st_mode):
        kind = next(
            (word for test, word in (
                (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"),
            ) if test(facts.st_mode)), "a device",
        )  # fmt: skip
        raise RecipeError(f"is {kind}", where=path, allowed="a file")
    allow("bytes", facts.st_size, where=path)


def check_archive(archive: zipfile.ZipFile, path: str | Path) -> None:
    """Refuse an archive that unpacks to more than the limit, or that is encrypted.

    zipfile reads no more of a member than the member announces.

    Raises
    ------
    RecipeError
        Naming the limit.
    """
    members = archive.infolist()
    allow("unpacked", sum(member.file_size for member in members), where=path)
    if any(member.flag_bits & 1 for member in members):
        raise RecipeError("is encrypted", where=path)
