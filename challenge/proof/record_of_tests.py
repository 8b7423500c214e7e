"""The record of test runs: every look at a test population, with commit, reason and figures."""

import datetime
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

_HEAD = """# Record of test runs

Every judgement of a test population, in the order of the runs. A test set is never opened; only
these aggregates leave it. Sets of other makes (validation) stand here, too; they are opened after
their run. `flawforge challenge judge SET --aggregate --record FILE --reason TEXT` adds an entry.
"""
_GLANCE = "## At a glance"
_SHOWN = {
    "alarms on nulls": "alarms",
    "top-1, medium and strong, one effect": "named first",
    "precision, medium and strong": "precision",
    "recall, medium and strong": "recall",
    "unknowns flagged": "unknowns flagged",
    "expected calibration error of probabilities": "calibration error",
    "share of the oracle's gain, each case at most 1": "oracle's gain",
}
"""Figures of a run that stand in the overview, and what they are called there."""


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
    file.write_text(with_overview(before.rstrip() + "\n" + "\n".join(entry)), encoding="utf-8")


def with_overview(text: str) -> str:
    """Put a table of all runs before the first of them, in place of the one there was."""
    _, *sections = re.split(r"(?m)^(?=## )", text)
    runs = [section for section in sections if not section.startswith(_GLANCE)]
    table = [
        "| run | family | " + " | ".join(_SHOWN.values()) + " |",
        "| --- " * (len(_SHOWN) + 2) + "|",
        *(row for run in runs for row in _rows(run)),
    ]
    return "\n".join([_HEAD, _GLANCE, "", *table, "", "".join(runs)])


def _rows(run: str) -> Iterator[str]:
    """Yield a row of the overview for each family that a run judged."""
    day, made = re.findall(r"^## (\S+), (\S+)", run)[0]
    cells = [
        [cell.strip() for cell in line.strip("| ").split("|")]
        for line in run.splitlines() if line.startswith("| ")
    ]  # fmt: skip
    found = {name: values for name, *values in cells}
    for k, family in enumerate(found.get("figure", [])[:-1]):
        values = (found.get(name, [])[k : k + 1] for name in _SHOWN)
        shown = [value[0].partition(", 95 %")[0] if value else "" for value in values]
        yield f"| {day}, {made} | {family} | " + " | ".join(shown) + " |"
