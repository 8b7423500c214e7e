"""Height maps in text tables: a matrix of readings, or columns of position and height."""

from pathlib import Path

import numpy as np

from sensors.formats.height_map import HeightMap, scale_mm
from sensors.typed_yaml import RecipeError


def read_csv(path: Path, unit: str | None) -> HeightMap:
    """Read a matrix, rows being profiles."""
    text = path.read_text(encoding="utf-8", errors="replace")
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise RecipeError("is empty", where=path)
    separator = next((s for s in (";", "\t", ",") if s in lines[-1]), None)
    rows = []
    for number, line in enumerate(lines, start=1):
        try:
            rows.append([float(c) if c.strip() else np.nan for c in line.split(separator)])
        except ValueError:
            raise RecipeError("isn't a row of numbers", where=f"{path}:{number}") from None
    if len({len(row) for row in rows}) != 1:
        raise RecipeError("has rows of different lengths", where=path)
    return HeightMap(readings_mm=np.array(rows, dtype=np.float64) * scale_mm(unit))
