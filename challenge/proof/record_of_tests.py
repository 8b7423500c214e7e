"""The record of test runs: every look at a test population, with commit, reason and figures."""

import datetime
import subprocess
from collections.abc import Sequence
from pathlib import Path

_HEAD = """# Record of test runs

Every judgement of a test population, in the order of the runs. A test set is never opened; only
these aggregates leave it. Sets of other makes (validation) stand here, too; they are opened after
their run. `flawforge challenge judge SET --aggregate --record FILE --reason TEXT` adds an entry.
"""


def commit(root: Path) -> str:
    """Return the commit of a checkout, marked `-dirty` where it was changed since."""
    said = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=9"],
        capture_output=True, text=True, cwd=root, check=False,
    )  # fmt: skip
    return said.stdout.strip() or "unknown"


def enter(file: Path, *, reason: str, commit: str, lines: Sequence[str]) -> None:
    """Add one run to the record.

    Raises
    ------
    ValueError
        Where no reason is given.
    """
    if not reason.strip():
        raise ValueError("--reason: missing; a test run is entered with its reason")
    before = file.read_text(encoding="utf-8") if file.exists() else _HEAD
    day = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    entry = ["", f"## {day}, {commit}", "", reason.strip(), "", *lines, ""]
    file.write_text(before.rstrip() + "\n" + "\n".join(entry), encoding="utf-8")
