r"""LMI Gocator's CSV export: sections of names and values, then a matrix headed `Y\X`."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from files.errors import RecipeError
from sensors.formats.height_map import Floats, HeightMap, scale_mm
from sensors.formats.text.cells import number

CORNER = re.compile(r"(?i)^\s*\"?y\s*[\\/]\s*x\"?$")


def is_gocator(lines: list[str]) -> bool:
    r"""Return whether a file's first line opens a section and a matrix headed `Y\X` follows."""
    first = next((line.strip() for line in lines if line.strip()), "")
    return re.fullmatch(r"[A-Za-z ]+,*", first) is not None and any(
        CORNER.match(line.split(",")[0]) for line in lines
    )


def read_gocator(lines: list[str], unit: str | None, path: Path) -> HeightMap:
    """Read the first surface, in mm, and the brightness that follows it where there is one."""
    words = _words(lines)
    blocks = [k for k, line in enumerate(lines) if CORNER.match(line.split(",")[0])]
    surface, x, y = _matrix(lines, blocks[0], path)
    bright = None
    if len(blocks) > 1 and "intensity" in " ".join(lines[blocks[0] : blocks[1]][-6:]).lower():
        bright, _, _ = _matrix(lines, blocks[1], path)
    scale = scale_mm(unit)
    step = words.get("ZResolution")
    note = " ".join(f"Gocator {words.get('Model', '')}".split())
    found = HeightMap(
        readings_mm=surface * scale,
        x_mm=x * scale,
        y_mm=y * scale,
        step_mm=None if step is None or number(step) is None else float(step) * scale,
        note=note,
        unit_mm=scale,
        unit_stated=True,
        decisions=(
            "Gocator export: the first surface of the file, places from its axes (mm)",
            *((f"{len(blocks)} matrices in the file",) if len(blocks) > 1 else ()),
        ),
    )
    if bright is not None and bright.shape == surface.shape:
        found = replace(found, intensity=np.clip(np.nan_to_num(bright) / 255.0, 0.0, 1.0))
    return found


def _words(lines: list[str]) -> dict[str, str]:
    """Return values by name: a line of names is followed by one of values."""
    words: dict[str, str] = {}
    for names, values in zip(lines[:-1], lines[1:], strict=True):
        keys, given = names.split(","), values.split(",")
        if len(keys) == len(given) > 2 and all(re.match(r"[A-Za-z]", key) for key in keys if key):
            words |= {k.strip(): v.strip() for k, v in zip(keys, given, strict=True)}
    return words


def _matrix(lines: list[str], start: int, path: Path) -> tuple[Floats, Floats, Floats]:
    """Read a matrix with its axes: readings, x, y."""
    axis = [number(cell) for cell in _row(lines[start])[1:]]
    rows: list[list[float]] = []
    for k, line in enumerate(lines[start + 1 :], start=start + 2):
        cells = _row(line)
        values = [number(cell) for cell in cells]
        if not line.strip() or values[0] is None:
            break
        if len(cells) != len(axis) + 1 or None in values:
            raise RecipeError("isn't a row of the matrix", where=f"{path}:{k}")
        rows.append([value for value in values if value is not None])
    table = np.array(rows, dtype=np.float64)
    if None in axis or not len(table):
        raise RecipeError("has a matrix without numbers", where=f"{path}:{start + 1}")
    return table[:, 1:], np.array(axis, dtype=np.float64), table[:, 0]


def _row(line: str) -> list[str]:
    return [cell.strip() for cell in line.rstrip("\r\n").split(",")]
