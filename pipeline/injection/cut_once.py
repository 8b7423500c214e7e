"""A specimen that several workers scan is cut by one of them; the others take what it kept."""

import fcntl
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

from files.whole_file import write_whole
from pipeline.injection.flawed_part import FlawedPart


def cut_once(
    kept: Path, cut: Callable[[], FlawedPart], meanwhile: Callable[[], Any]
) -> FlawedPart:
    """Cut a flawed part and keep it, or take what another worker kept; wait for one at it.

    A worker that has to wait does `meanwhile` what its scans will need.
    The lock is the operating system's: it is gone when its worker is, and the next one cuts.
    What is kept is read in the run that wrote it alone, see `pipeline.dataset.folder.drop_parts`.
    """
    with kept.with_suffix(".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            meanwhile()
            fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            flawed = cut()
            write_whole(kept, pickle.dumps(flawed, protocol=5))
            return flawed
    found: FlawedPart = pickle.loads(kept.read_bytes())
    return found
