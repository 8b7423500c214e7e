"""An unexpected error: a report is saved, and the user gets one line."""

import platform
import tempfile
import traceback
from importlib.metadata import version


def report(error: BaseException, words: list[str]) -> str:
    """Save the traceback of an error; return the line for the user.

    The report holds the command line, versions and the traceback, no data.
    """
    text = "\n".join(
        [
            "flawforge " + " ".join(words),
            f"flawforge {version('flawforge')}, Python {platform.python_version()}, "
            f"{platform.platform()}",
            "",
            "".join(traceback.format_exception(error)),
        ]
    )
    said = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="flawforge-crash-", suffix=".txt", delete=False, encoding="utf-8",
            errors="backslashreplace",
        ) as file:  # fmt: skip
            file.write(text)
    except OSError:
        return f"an error of ours ({said}); with --debug it shows where it came from"
    return f"an error of ours ({said}); please send {file.name} to the maintainers"


def is_memory(error: BaseException) -> bool:
    """Return whether an error means that memory ran out."""
    return isinstance(error, MemoryError) or "Unable to allocate" in str(error)

