"""From lines of text to rows of cells: separators, decimal commas, trailing separators."""

import re
from dataclasses import dataclass

Rows = list[list[str]]

MISSING = {
    "", "nan", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan", "-1.#ind", "inf", "-inf", "-", "--",
    "---", "***", "null", "none", "na", "n/a", "#n/a", "bad", "invalid", "void", "x.xxx",
}  # fmt: skip
SEPARATORS = (";", "\t", ",", "|", None)
_SAMPLE = 400


@dataclass(frozen=True, kw_only=True, slots=True)
class Cells:
    """Rows of cells as text, one for each line, and how they were told apart.

    Attributes
    ----------
    rows
        Empty lines are empty rows; decimal commas are points.
    separator
        Between cells; None: white space.
    trailing
        Whether each row ended in a separator, which was dropped.
    """

    rows: Rows
    separator: str | None
    trailing: bool


def number(cell: str) -> float | None:
    """Return a cell's number, NaN for a word that stands for a missing one, None for others."""
    if cell.lower() in MISSING:
        return float("nan")
    try:
        value = float(cell)
    except ValueError:
        return None
    # "1_000" is a number to Python alone.
    return None if "_" in cell else value


def split(lines: list[str]) -> Cells:
    """Split lines by the separator and the decimal sign that make the most numbers of them.

    Where two do equally well the earlier of `; tab , |` and white space wins, and the decimal
    point over the comma.
    """
    filled = [line for line in lines if line.strip() and not line.lstrip().startswith(("#", "%"))]
    # The end and the middle: headers stand at the beginning.
    sample = filled[-_SAMPLE:] if len(filled) > _SAMPLE else filled
    best: tuple[float, str | None, bool] | None = None
    for separator in SEPARATORS:
        for comma in (False, True):
            if comma and separator == ",":
                continue
            score = _score(sample, separator, comma)
            if best is None or score > best[0] + 1e-9:
                best = (score, separator, comma)
    assert best is not None
    _, separator, comma = best
    rows = [_cells(line, separator, comma) for line in lines]
    rows, trailing = _without_trailing(rows)
    return Cells(rows=rows, separator=separator, trailing=trailing)


def _cells(line: str, separator: str | None, comma: bool) -> list[str]:
    if not line.strip():
        return []
    parts = line.split(separator) if separator is not None else line.split()
    cells = [part.strip().strip('"').strip() for part in parts]
    if comma:
        cells = [re.sub(r"^([+-]?\d*),(\d*(?:[eE][+-]?\d+)?)$", r"\1.\2", cell) for cell in cells]
    return cells


def _score(lines: list[str], separator: str | None, comma: bool) -> float:
    """Return how many cells are numbers in rows that are all numbers, two columns or more first."""
    total = 0.0
    for line in lines:
        cells = _cells(line, separator, comma)
        values = [number(cell) for cell in cells]
        if None in values or not any(value == value for value in values):
            continue
        filled = sum(1 for cell in cells if cell)
        total += filled if len(cells) > 1 else 0.5
    return total


def _without_trailing(rows: Rows) -> tuple[Rows, bool]:
    """Drop the empty last cells where every row of numbers ends in separators.

    A name over them makes a column whose values are all missing; that one stays.
    """
    at = [k for k, row in enumerate(rows) if len(row) > 1 and is_numbers(row)]
    if len(at) < 2:
        return rows, False
    head = next((row for row in reversed(rows[: at[0]]) if row), [])
    empty = min(_trailing(rows[k]) for k in at)
    width = max(len(rows[k]) for k in at)
    empty = min(empty, width - len(head)) if len(head) > 1 and not _trailing(head) else empty
    if empty < 1:
        return rows, False
    return [row[: len(row) - min(empty, _trailing(row))] for row in rows], True


def _trailing(row: list[str]) -> int:
    """Return how many cells at a row's end are empty."""
    count = 0
    while count < len(row) and not row[len(row) - 1 - count]:
        count += 1
    return count


def is_numbers(row: list[str]) -> bool:
    """Return whether a row holds nothing but numbers, one at least that isn't missing."""
    values = [number(cell) for cell in row]
    return None not in values and any(value == value for value in values)
