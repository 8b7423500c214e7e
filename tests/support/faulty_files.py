"""A file layer that fails once: at a chosen write, sync, rename or new folder.

It lies under Python's own files: `open`, `pathlib`, HDF5's output, tar files and pictures. Arrow
writes past it.
"""

import builtins
import errno
import io
import os
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock


class Faults:
    """Counts operations; the one numbered `at` fails, a write after half of its bytes."""

    def __init__(self, at: int | None = None, code: int = errno.EIO) -> None:
        self.at, self.code, self.count = at, code, 0
        self.what = ""

    def fails(self, what: str) -> bool:
        """Count an operation; whether it is the one that fails."""
        self.count += 1
        if self.count - 1 == self.at:
            self.what = what
            return True
        return False

    def error(self, name: Any) -> OSError:
        """Return the fault as the system would raise it."""
        return OSError(self.code, os.strerror(self.code), os.fspath(name))


class _Raw(io.FileIO):
    """A file whose writes are counted."""

    faults: Faults

    def write(self, data: Any, /) -> int:
        """Write, or fail halfway."""
        if self.faults.fails("write"):
            half = memoryview(data).cast("B")
            super().write(half[: len(half) // 2])
            raise OSError(self.faults.code, os.strerror(self.faults.code))
        return super().write(data)


@contextmanager
def failing(faults: Faults) -> Iterator[None]:
    """Put the layer under all files that are written within a context."""
    known, replace, fsync, mkdir = io.open, os.replace, os.fsync, os.mkdir

    def open_file(
        file: Any, mode: str = "r", buffering: int = -1, encoding: str | None = None,
        errors: str | None = None, newline: str | None = None, closefd: bool = True,
        opener: Any = None,
    ) -> Any:  # fmt: skip
        if not set(mode) & set("wax+") or isinstance(file, int):
            return known(file, mode, buffering, encoding, errors, newline, closefd, opener)
        raw = _Raw(file, mode.replace("b", "").replace("t", ""), closefd, opener)
        raw.faults = faults
        if buffering == 0:
            return raw
        buffer = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        if "b" in mode:
            return buffer
        return io.TextIOWrapper(buffer, encoding or "utf-8", errors, newline)

    def counted(what: str, act: Any) -> Any:
        def run(*words: Any, **more: Any) -> Any:
            if faults.fails(what):
                raise faults.error(words[0] if isinstance(words[0], str | os.PathLike) else "")
            return act(*words, **more)

        return run

    with (
        mock.patch.object(io, "open", open_file), mock.patch.object(builtins, "open", open_file),
        mock.patch.object(tarfile, "bltn_open", open_file),
        mock.patch.object(os, "replace", counted("rename", replace)),
        mock.patch.object(os, "fsync", counted("sync", fsync)),
        mock.patch.object(os, "mkdir", counted("new folder", mkdir)),
    ):  # fmt: skip
        yield
