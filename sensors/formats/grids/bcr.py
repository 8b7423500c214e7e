"""BCR-STM and BCRF: images of heights with a header of names and values (Image Metrology)."""

import re
from pathlib import Path

import numpy as np

from files.errors import RecipeError
from sensors.formats.height_map import HeightMap, scale_mm

HEADERS = {"bcrstm": 2048, "bcrf": 2048, "bcrstm_unicode": 4096, "bcrf_unicode": 4096}
VOID = {"i2": 32767.0, "f4": 1e38}  # floats from there on are missing


def read_bcr(path: Path, unit: str | None) -> HeightMap:
    """Read heights; they are nm unless the header names a unit, `unit` overrides that."""
    blob = path.read_bytes()
    text = blob[:4096].decode("utf-16-le", "ignore")
    if "fileformat" not in text:
        text = blob[:2048].decode("latin-1")
    words = dict(re.findall(r"(?m)^\s*(\w+)\s*=\s*([^\r\n\0%]*)", text))
    words = {key.lower(): value.strip() for key, value in words.items()}
    kind = words.get("fileformat", "").lower()
    if kind not in HEADERS:
        raise RecipeError("isn't a BCR file", where=path, value=kind, allowed=", ".join(HEADERS))
    # A header in UTF-16 has two bytes for each of its 2048 signs.
    start = HEADERS[kind] if "unicode" in kind else int(_real(words, "headersize", path, 2048))
    columns, rows = (int(_real(words, key, path)) for key in ("xpixels", "ypixels"))
    form = "f4" if kind.startswith("bcrf") else "i2"
    order = "<" if int(_real(words, "intelmode", path, 1)) else ">"
    wanted = rows * columns * np.dtype(form).itemsize
    body = blob[start : start + wanted]
    if columns < 1 or rows < 1 or len(body) < wanted:
        raise RecipeError(
            f"announces {rows} × {columns} readings and ends early", where=path, value=len(body)
        )
    raw = np.frombuffer(body, order + form).astype(np.float64).reshape(rows, columns)
    missing = raw >= VOID[form] if form == "f4" else raw == VOID[form]
    if int(_real(words, "voidpixels", path, 0)) == 0 and form == "i2":
        missing[:] = False
    step = _real(words, "bit2nm", path, 1.0) * scale_mm(unit, words.get("zunit") or "nm")
    readings = raw * step
    readings[missing | ~np.isfinite(raw)] = np.nan
    lengths = [
        _real(words, f"{axis}length", path) * scale_mm(None, words.get(f"{axis}unit") or "nm")
        for axis in "xy"
    ]
    return HeightMap(
        readings_mm=readings,
        x_mm=np.arange(columns) * lengths[0] / columns,
        y_mm=np.arange(rows) * lengths[1] / rows if rows > 1 else None,
        step_mm=step if form == "i2" else None,
        note=f"BCR {kind}",
        unit_mm=step,
        unit_stated=True,
    )


def _real(
    words: dict[str, str], key: str, path: Path, default: float | None = None
) -> float:
    if key not in words and default is not None:
        return default
    try:
        return float(words[key])
    except (KeyError, ValueError):
        raise RecipeError(f"states no {key}", where=path, value=words.get(key)) from None
