"""Height maps in tables of text: a matrix, columns of position and heights, or points x, y, z."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from files.errors import RecipeError
from sensors.formats.height_map import Floats, HeightMap, scale_mm, unit_decision
from sensors.formats.text.axes import is_counter, without_axes
from sensors.formats.text.cells import Rows, is_numbers, number, split
from sensors.formats.text.decode import decoded
from sensors.formats.text.gocator import CORNER, is_gocator, read_gocator
from sensors.formats.text.headers import Header, read_header
from sensors.formats.text.names import role_of
from sensors.formats.text.points import MIN_POINTS, are_points, points_map
from sensors.formats.units import LENGTHS_MM, length_in, time_in

MIN_PROFILE = 3  # rows from which two columns, the first rising, are a profile and no matrix
SIDE = ("counter", "quality", "time", "encoder", "brightness")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Table:
    """A table's numbers with what stands before them.

    Attributes
    ----------
    values : (n, m)
        Numbers, NaN where missing.
    texts
        The first position's cells as they are printed.
    names
        Names of the columns, or none.
    header
        What the lines before state.
    """

    values: Floats
    texts: Rows
    names: tuple[str, ...]
    header: Header


def read_csv(
    path: Path, unit: str | None, columns: Mapping[str, str] | None = None
) -> HeightMap:
    """Read a table; words may stand before its numbers (a report, names of columns, units).

    A matrix has a profile in each row; axes in its first row and column are recognised. Where the
    columns' names begin with a position (`x_mm,z_um`), or where there are two columns and the
    first rises, the other columns are profiles. Names `x,y,z`, or three columns that run through
    a grid, are points; points in rows of one y with an x of their own are unrectified profiles.
    Columns that count, time or flag the rows are no readings. `unit` is that of heights, and with
    `x,y,z` of all three; without it the header's units hold (`z_um`, `Lateral um`). `columns` gives
    the named columns' roles; others are left out.
    """
    lines = decoded(path.read_bytes()).splitlines()
    if not any(line.strip() for line in lines):
        raise RecipeError("is empty", where=path)
    if is_gocator(lines):
        return read_gocator(lines, unit, path)
    cells = split(lines)
    found = from_rows(cells.rows, unit, path, lines, columns)
    if not cells.trailing:
        return found
    words = ("each row ends in a separator, which is no column",)
    return replace(found, decisions=(*words, *found.decisions))


def from_rows(
    rows: Rows,
    unit: str | None,
    path: Path,
    lines: list[str] | None = None,
    columns: Mapping[str, str] | None = None,
) -> HeightMap:
    """Read a table of cells as a height map; empty rows between are skipped."""
    table = _table(rows, path, lines)
    roles = [role_of(name) for name in table.names]
    if columns:
        unknown = [name for name in columns if name not in table.names]
        if unknown:
            raise RecipeError(
                f"has no column {unknown[0]!r}", where=path,
                value=", ".join(table.names) or "no names",
            )  # fmt: skip
        given = {"intensity": "brightness"}
        roles = [given.get(columns[name], columns[name]) if name in columns else "quality"
                 for name in table.names]  # fmt: skip
    if table.names and CORNER.match(table.names[0]):
        return _corner(table, unit)
    if table.names and any(roles):
        return _named(table, roles, unit, path)
    return _unnamed(table, unit, path)


def _table(rows: Rows, path: Path, lines: list[str] | None) -> Table:
    """Find the numbers among the rows, and what stands before them.

    The numbers begin with the first row as wide as most rows of numbers are: before it may stand
    a line with their count.
    """
    widths = [len(row) for row in rows if is_numbers(row)]
    if not widths:
        raise RecipeError("holds no numbers", where=path)
    counts = np.bincount(widths)
    width = int(np.flatnonzero(counts == counts.max())[-1])
    start = next(k for k, row in enumerate(rows) if is_numbers(row) and len(row) == width)
    head = [row for row in rows[:start] if row]
    for k, row in enumerate(rows[:start]):
        numbers = [number(cell) for cell in row]
        known = sum(value is not None for value in numbers)
        axis = bool(row) and numbers[0] is None and _rises(numbers[1:])
        if known > len(row) / 2 and len(row) == width > 2 and known < width and not axis:
            raise RecipeError("isn't a row of numbers", where=f"{path}:{k + 1}")
    values, texts = _numbers(rows, start, width, path)
    names: tuple[str, ...] = ()
    for row in reversed(head):
        cells = [cell.lstrip("#").strip() for cell in row]
        if len(cells) == width and not all(_is_unit(cell) for cell in cells):
            names = tuple(cells)
            break
    plain = [" ".join(row) for row in head]
    said = read_header(lines[:start] if lines is not None else plain)
    return Table(values=values, texts=texts, names=names, header=said)


def _numbers(rows: Rows, start: int, width: int, path: Path) -> tuple[Floats, Rows]:
    values: list[list[float]] = []
    texts: Rows = []
    for k, row in enumerate(rows[start:], start=start + 1):
        if not row or row[0].startswith(("#", "%")):
            continue
        numbers = [number(cell) for cell in row]
        if None in numbers:
            raise RecipeError("isn't a row of numbers", where=f"{path}:{k}")
        if len(row) != width:
            raise RecipeError(
                "has rows of different lengths",
                where=f"{path}:{k}",
                value=len(row),
                allowed=f"{width} numbers as in most rows",
            )
        values.append([value for value in numbers if value is not None])
        texts.append(row)
    table = np.array(values, dtype=np.float64)
    table[~np.isfinite(table)] = np.nan
    return table, texts


def _named(table: Table, roles: list[str | None], unit: str | None, path: Path) -> HeightMap:
    """Read a table whose columns' names say what they hold."""
    side = {role: roles.index(role) for role in SIDE if role in roles}
    kept = [k for k, role in enumerate(roles) if role not in SIDE]
    kinds = [roles[k] for k in kept]
    words = tuple(
        f"column {table.names[k]!r} holds no readings ({role})"
        for k, role in enumerate(roles)
        if role in ("counter", "quality")
    )
    units = _units(table)
    found: HeightMap
    if all(axis in kinds for axis in "xyz"):
        places = [roles.index(axis) for axis in "xyz"]
        bright = table.values[:, side["brightness"]] if "brightness" in side else None
        found = points_map(table.values[:, places], [units[k] for k in places], unit, path, bright)
        return replace(found, decisions=(*words, *found.decisions))
    if kinds and kinds[0] == "x":
        found = _profiles(table, kept, units, unit, path)
        return replace(found, decisions=(*words, *found.decisions))
    along = next((k for k in kept if roles[k] == "y"), None)
    readings = [k for k in kept if k != along]
    if not readings:
        raise RecipeError(
            "has no column of heights", where=path, value=", ".join(table.names),
            allowed="names such as z, z_mm, height, or numbers",
        )  # fmt: skip
    held = _held(table.header, [units[k] for k in readings])
    scale = scale_mm(unit, held)
    numbers = [number(table.names[k]) for k in readings]
    x = np.array(numbers, np.float64) if None not in numbers and len(numbers) > 1 else None
    if x is not None and not ((np.diff(x) > 0).all() or (np.diff(x) < 0).all()):
        x = None
    found = HeightMap(
        readings_mm=table.values[:, readings] * scale,
        x_mm=None if x is None else x * scale_mm(None, units[readings[0]]),
        unit_mm=scale,
        unit_stated=held is not None,
        decisions=(*words, *unit_decision(unit, held)),
    )
    return _with_rows(_with_pitch(found, table.header), table, side, along, units)


def _with_rows(
    found: HeightMap, table: Table, side: dict[str, int], along: int | None,
    units: list[str | None],
) -> HeightMap:  # fmt: skip
    """Add the rows' place, encoder and time from columns beside the readings."""
    words: list[str] = []
    if along is not None:
        found = replace(found, y_mm=table.values[:, along] * scale_mm(None, units[along]))
        words.append(f"column {table.names[along]!r} gives the rows' places")
    elif "encoder" in side and len(table.values) > 1:
        counts = table.values[:, side["encoder"]]
        name = table.names[side["encoder"]]
        if np.isfinite(counts).all() and np.ptp(counts) > 0:
            found = replace(found, y_mm=counts, row_counts=True)
            words.append(f"column {name!r} gives the rows' places in counts; no reading")
    if "time" in side:
        name = table.names[side["time"]]
        second = time_in(name)
        times = table.values[:, side["time"]]
        steps = np.diff(times)
        if second is not None and np.isfinite(times).all() and (steps >= 0).all():
            found = replace(found, time_s=(times - times[0]) * second)
            words.append(f"column {name!r} gives the rows' times")
        else:
            words.append(f"column {name!r} holds times of no stated unit; not used")
    return replace(found, decisions=(*found.decisions, *words))


def _corner(table: Table, unit: str | None) -> HeightMap:
    r"""Read a matrix whose first row and column are axes, headed `Y\X`."""
    numbers = [number(name) for name in table.names[1:]]
    x = np.array([np.nan if value is None else value for value in numbers], np.float64)
    held = _held(table.header, [])
    scale = scale_mm(unit, held)
    return HeightMap(
        readings_mm=table.values[:, 1:] * scale,
        x_mm=x * scale,
        y_mm=table.values[:, 0] * scale,
        unit_mm=scale,
        unit_stated=held is not None,
        decisions=("the first row and column are axes", *unit_decision(unit, held)),
    )


def _unnamed(table: Table, unit: str | None, path: Path) -> HeightMap:
    """Read a table by its numbers alone."""
    values, units = table.values, list(table.header.column_units)
    words: tuple[str, ...] = ()
    texts = table.texts
    counted = values.shape[1] == 3 and len(values) >= MIN_PROFILE and is_counter(values[:, 0])
    if counted and (np.diff(values[:, 1]) > 0.0).all():
        values, words = values[:, 1:], ("the first column counts the rows",)
        texts = [row[1:] for row in texts]
    rising = len(values) >= MIN_PROFILE and bool((np.diff(values[:, 0]) > 0.0).all())
    if values.shape[1] == 2 and rising:
        plain = replace(table, values=values, texts=texts)
        pair: list[str | None] = [*units, None, None][:2]
        found = _profiles(plain, [0, 1], pair, unit, path)
        return replace(found, decisions=(*words, *found.decisions))
    long = values.shape[1] == 3 and len(values) >= MIN_POINTS  # no scan has three columns
    if values.shape[1] in (3, 4) and (long or are_points(values)):
        triple: list[str | None] = [*units, None, None, None][:3]
        bright = values[:, 3] if values.shape[1] == 4 else None
        return points_map(values[:, :3], triple, unit, path, bright)
    held = _held(table.header, units[:1])
    scale = scale_mm(unit, held)
    factor = table.header.factor_mm
    if factor is not None and unit is None:
        scale, held = factor, None
        words = (*words, f"one count is {factor:.6g} mm, as the file says")
    axes = without_axes(values)
    found = HeightMap(
        readings_mm=axes.table * scale,
        x_mm=None if axes.x is None else axes.x * scale,
        y_mm=None if axes.y is None else axes.y * scale,
        unit_mm=scale,
        unit_stated=held is not None or factor is not None,
        decisions=(*words, *axes.dropped, *unit_decision(unit, held)),
    )
    return _with_pitch(found, table.header)


def _with_pitch(found: HeightMap, header: Header) -> HeightMap:
    """Add places of columns and rows that the header states."""
    rows, columns = found.readings_mm.shape
    if header.width_mm is not None and header.height_mm is not None:
        pitch = (header.width_mm / columns, header.height_mm / rows)
    else:
        pitch = (header.pitch_x_mm or 0.0, header.pitch_y_mm or header.pitch_x_mm or 0.0)
    words: tuple[str, ...] = ()
    x, y = found.x_mm, found.y_mm
    if x is None and pitch[0] > 0:
        x = np.arange(columns) * pitch[0]
        words = (f"columns {pitch[0]:.6g} mm apart, as the file says",)
    if y is None and pitch[1] > 0 and rows > 1:
        y = np.arange(rows) * pitch[1]
        words = (*words, f"rows {pitch[1]:.6g} mm apart, as the file says")
    return replace(found, x_mm=x, y_mm=y, decisions=(*found.decisions, *words))


def _held(header: Header, units: Sequence[str | None]) -> str | None:
    """Return the unit of heights that the file states: the header's, else the columns'."""
    return header.unit or next((unit for unit in units if unit is not None), None)


def _units(table: Table) -> list[str | None]:
    """Return the unit that each column's name, or a line of units, states."""
    named = [length_in(name) for name in table.names]
    stated = table.header.column_units
    if not any(named) and len(stated) == len(table.names):
        return list(stated)
    return named


def _profiles(
    table: Table, columns: list[int], units: list[str | None], unit: str | None, path: Path
) -> HeightMap:
    """Read a column of positions and columns of heights: each of them is a profile."""
    x = table.values[:, columns[0]]
    if not np.isfinite(x).all() or not (np.diff(x) > 0.0).all():
        raise RecipeError("has positions that don't rise from row to row", where=path)
    heights = columns[1:]
    if not heights:
        raise RecipeError("has positions and no heights", where=path)
    values = table.values[:, heights]
    filled = ~np.isnan(values).all(axis=0)
    last = int(np.flatnonzero(filled)[-1]) + 1 if filled.any() else 1
    held_x, named = units[columns[0]], next((units[k] for k in heights if units[k]), None)
    held = _held(table.header, [named])
    words: list[str] = []
    if held is None and held_x is not None and unit is None:
        held = held_x
        words.append(f"heights are in {held_x}, the one unit that the header names")
    else:
        words += unit_decision(unit, held)
    if held_x is None and held is not None and table.names:
        held_x = held if unit is None else None
    texts = [row[columns[0]] for row in table.texts]
    places = even_if_rounded(x, texts) * scale_mm(held_x)
    scale = scale_mm(unit, held)
    return HeightMap(
        readings_mm=values[:, :last].T * scale,
        x_mm=places,
        unit_mm=scale,
        unit_stated=held is not None,
        decisions=tuple(words),
    )


def even_if_rounded(x: Floats, texts: list[str]) -> Floats:
    """Return even places where the positions are even ones printed with few decimals."""
    even = np.linspace(x[0], x[-1], x.size)
    if all(re.fullmatch(r"[+-]?\d+(\.\d*)?", text) for text in texts):
        digits = max(len(text.partition(".")[2]) for text in texts)
        if np.abs(x - even).max() <= 1.01 * 10.0**-digits and 10.0**-digits > 0.05 * (x[1] - x[0]):
            return even
    return x


def _rises(numbers: list[float | None]) -> bool:
    """Return whether a row's numbers run one way, as an axis does."""
    steps = np.diff([np.nan if value is None else value for value in numbers])
    return bool((steps > 0).all() or (steps < 0).all())


def _is_unit(cell: str) -> bool:
    return cell.lower().strip("[]() ") in LENGTHS_MM
