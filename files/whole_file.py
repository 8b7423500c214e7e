"""Files that are either complete or unchanged: written aside, then renamed."""

import errno
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: str | Path, *, synced: bool = False) -> Iterator[Path]:
    """Write a file under another name within a context; afterwards it has its own.

    Parameters
    ----------
    path
        The file's own name.
    synced
        Whether it must outlive a power cut, too: it reaches the disk before it is renamed.

    Yields
    ------
    Path
        A hidden name beside the file's, with its suffix. Nothing stays there after a fault. A
        device or a pipe is written into as it stands.

    Raises
    ------
    OSError
        Of the system, about the file's own name.
    """
    given = Path(path)
    if given.exists() and not given.is_file():
        if given.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(given))
        yield given  # a device or a pipe, which a file must never replace
        return
    path = Path(os.path.realpath(given))  # a link stays one
    aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}.part{path.suffix}")
    try:
        yield aside
        if synced:
            sync(aside)
        os.replace(aside, path)
        if synced:
            sync(path.parent)
    except BaseException as fault:
        aside.unlink(missing_ok=True)
        if isinstance(fault, OSError) and fault.filename == str(aside):
            fault.filename, fault.filename2 = str(given), None
        raise


def write_whole(path: str | Path, content: str | bytes, *, synced: bool = True) -> None:
    """Write a file, text as UTF-8."""
    with whole(path, synced=synced) as aside:
        aside.write_bytes(content.encode() if isinstance(content, str) else content)


def sync(path: Path) -> None:
    """Make sure that a file, or a folder's list of names, has reached the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
