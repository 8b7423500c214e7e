"""Height maps in tables of text: a matrix, columns of position and heights, or points x, y, z."""

import re
from pathlib import Path

import numpy as np

from sensors.formats.clouds import Cloud, to_height_map
from sensors.formats.height_map import UNITS_MM, Floats, HeightMap, scale_mm
from sensors.typed_yaml import RecipeError

Rows = list[list[str]]

MISSING = {"", "nan", "-", "--", "---", "***", "null", "none", "na", "n/a", "#n/a", "bad"}
POSITION = re.compile(r"(?i)^(x|lateral|position|distance|length)(?![a-z])")
UNIT = re.compile(r"(?i)(?:^|[_\s\[(])(mm|cm|nm|um|µm|μm|m|in|micrometer)[\])]?$")
MIN_PROFILE = 16  # rows from which two rising columns are a profile and no matrix


def read_csv(path: Path, unit: str | None) -> HeightMap:
    """Read a table; words may stand before its numbers (a Dektak's report, names of columns).

    A matrix has a profile in each row. Where the columns' names begin with a position
    (`x_mm,z_um`), or where there are two columns and the first rises, the other columns are
    profiles. Names `x,y,z`, or three columns that run through a grid, are points.
    `unit` is that of heights, and with `x,y,z` of all three; without it the names' units hold
    (`z_um`, `Lateral um`).
    """
    blob = path.read_bytes()
    try:
        text = blob.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = blob.decode("latin-1")
    lines = text.splitlines()
    filled = [line for line in lines if line.strip()]
    if not filled:
        raise RecipeError("is empty", where=path)
    separator = next((s for s in (";", "\t", ",") if s in filled[-1]), None)
    rows = [
        [cell.strip() for cell in line.split(separator)] if line.strip() else [] for line in lines
    ]
    if separator != "," and any("," in cell for row in rows[-3:] for cell in row):
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]  # decimal commas
    return from_rows(rows, unit, path)


def from_rows(rows: Rows, unit: str | None, path: Path) -> HeightMap:
    """Read a table of cells as a height map; empty rows between are skipped."""
    start = next((k for k, row in enumerate(rows) if _is_numbers(row)), None)
    if start is None:
        raise RecipeError("holds no numbers", where=path)
    names: list[str] = []
    for k, row in enumerate(rows[:start]):
        numbers = sum(_number(cell) is not None for cell in row)
        if numbers > len(row) / 2 and len(row) == len(rows[start]) > 2:
            raise RecipeError("isn't a row of numbers", where=f"{path}:{k + 1}")
        names = [cell.lstrip("#").strip() for cell in row] if row else names
    values: list[list[float]] = []
    for k, row in enumerate(rows[start:], start=start + 1):
        if not row:
            continue
        numbers_or_none = [_number(cell) for cell in row]
        if any(number is None for number in numbers_or_none):
            raise RecipeError("isn't a row of numbers", where=f"{path}:{k}")
        if len(row) != len(rows[start]):
            raise RecipeError(
                "has rows of different lengths",
                where=f"{path}:{k}",
                value=len(row),
                allowed=f"{len(rows[start])} numbers as before",
            )
        values.append([number for number in numbers_or_none if number is not None])
    table = np.array(values, dtype=np.float64)
    lower = [re.split(r"[_\s\[(]", name.lower())[0] for name in names]
    if lower[:3] == ["x", "y", "z"] and table.shape[1] >= 3:
        return _points(table, [_unit(name) for name in names[:3]], unit, path)
    if names and POSITION.match(names[0]) and table.shape[1] >= 2:
        empty = np.isnan(table).all(axis=0)
        last = int(np.flatnonzero(~empty)[-1]) + 1 if not empty.all() else 2
        texts = [row[0] for row in rows[start:] if row]
        units = [_unit(name) for name in names[:2]]
        return _profiles(table[:, : max(last, 2)], texts, units, unit, path)
    rising = len(table) >= MIN_PROFILE and bool((np.diff(table[:, 0]) > 0.0).all())
    if table.shape[1] == 2 and rising:
        texts = [row[0] for row in rows[start:] if row]
        return _profiles(table, texts, [None, None], unit, path)
    if table.shape[1] == 3 and len(table) >= MIN_PROFILE and _runs_through(table):
        return _points(table, [None] * 3, unit, path)
    return HeightMap(readings_mm=table * scale_mm(unit), unit_mm=scale_mm(unit))


def _profiles(
    table: Floats, texts: list[str], units: list[str | None], unit: str | None, path: Path
) -> HeightMap:
    x = table[:, 0]
    if not np.isfinite(x).all() or not (np.diff(x) > 0.0).all():
        raise RecipeError("has positions that don't rise from row to row", where=path)
    places = even_if_rounded(x, texts) * scale_mm(units[0])
    scale = scale_mm(unit, units[1] if len(units) > 1 else None)
    return HeightMap(readings_mm=table[:, 1:].T * scale, x_mm=places, unit_mm=scale)


def even_if_rounded(x: Floats, texts: list[str]) -> Floats:
    """Return even places where the positions are even ones printed with few decimals."""
    even = np.linspace(x[0], x[-1], x.size)
    if all(re.fullmatch(r"[+-]?\d+(\.\d*)?", text) for text in texts):
        digits = max(len(text.partition(".")[2]) for text in texts)
        if np.abs(x - even).max() <= 1.01 * 10.0**-digits and 10.0**-digits > 0.05 * (x[1] - x[0]):
            return even
    return x


def _points(table: Floats, units: list[str | None], unit: str | None, path: Path) -> HeightMap:
    scales = np.array([scale_mm(unit, held) for held in units])
    return to_height_map(Cloud(points_mm=table[:, :3] * scales), path)


def _runs_through(table: Floats) -> bool:
    columns, rows = np.unique(table[:, 0]).size, np.unique(table[:, 1]).size
    whole = np.isfinite(table[:, :2]).all() and columns * rows == len(table)
    return bool(whole) and min(columns, rows) > 1


def _unit(name: str) -> str | None:
    found = UNIT.search(name.strip())
    if found is None:
        return None
    word = found.group(1).lower()
    return word if word in UNITS_MM or word == "micrometer" else "um"


def _is_numbers(row: list[str]) -> bool:
    numbers = [_number(cell) for cell in row]
    return bool(row) and None not in numbers and any(n == n for n in numbers)


def _number(cell: str) -> float | None:
    if cell.lower() in MISSING:
        return np.nan
    try:
        return float(cell)
    except ValueError:
        return None
