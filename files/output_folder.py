"""A folder of results: made before the work, and taken back where the work fails."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def output_folder(folder: Path) -> Iterator[Path]:
    """Make a folder, so that one that can't be written fails before any work.

    Where the work fails, the folders that were made here and are still empty are removed.
    """
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield folder
    except BaseException:
        with suppress(OSError):  # not empty: something was written
            for place in made:
                place.rmdir()
        raise
