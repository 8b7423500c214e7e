"""A cache folder for compiled loops where installation and home are read-only."""

import os
import stat
import tempfile
from pathlib import Path
from typing import Final

VARIABLE: Final = "NUMBA_CACHE_DIR"


def keep_loops(installed: Path) -> None:
    """Set a writable cache folder where numba would find none and fail.

    Numba keeps what it compiled beside the source, else in the user's cache. An image that is
    mounted read-only, run by a user without a home, has neither: then the folder is in the
    temporary one. Processes that are started later inherit the choice.

    Parameters
    ----------
    installed
        A folder of this installation.
    """
    if os.environ.get(VARIABLE) or os.access(installed, os.W_OK) or _has_user_cache():
        return
    folder = _own_folder()
    if folder is not None:
        os.environ[VARIABLE] = folder


def _has_user_cache() -> bool:
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(base) / "numba"
    if not folder.is_absolute():  # no home is known
        return False
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def _own_folder() -> str | None:
    """Return a folder that this user alone can write: numba runs what it finds there."""
    try:
        folder = Path(tempfile.gettempdir()) / f"flawforge-loops-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        facts = folder.lstat()
        if (
            stat.S_ISDIR(facts.st_mode)
            and facts.st_uid == os.getuid()
            and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        ):
            return str(folder)
        return tempfile.mkdtemp(prefix="flawforge-loops-")
    except OSError:  # nothing can be written anywhere
        return None
