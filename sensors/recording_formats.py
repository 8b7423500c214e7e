"""Height maps as other programs and instruments store them, read onto their own grid.

CSV, NPY, TIFF, organised PLY and PCD, and the JSON images of SICK's AppSpace. Nothing is resampled:
a reading keeps its row and its column.
"""

import base64
import binascii
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensors.typed_yaml import RecipeError

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class HeightMap:
    """A grid of heights with what its file says of it.

    Attributes
    ----------
    values : (n, m) float64
        Heights or depths in the file's unit; NaN = missing. Rows follow the travel.
    intensity : (n, m) float64 or None, 0 to 1
    pitch_x, pitch_y : float or None
        In the file's unit, None where it doesn't say.
    origin_x : float
        x of the first column.
    unit_mm : float or None
        Millimetres in the file's unit, None where it doesn't say.
    rows : (n,) float64 or None
        Encoder counts or positions of the rows, where the file has them.
    """

    values: Floats
    intensity: Floats | None = None
    pitch_x: float | None = None
    pitch_y: float | None = None
    origin_x: float | None = None
    unit_mm: float | None = None
    rows: Floats | None = None


def read_height_map(path: str | Path) -> HeightMap:
    """Read a height map by its file's suffix.

    Raises
    ------
    RecipeError
        Where the suffix isn't known or the file isn't what its suffix says.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise RecipeError(
            "no reader for this kind of file", where=path, value=path.suffix,
            allowed=", ".join(sorted(READERS)),
        )  # fmt: skip
    try:
        return reader(path)
    except OSError as error:
        raise RecipeError(f"can't be read ({error.strerror or error})", where=path) from None
    except RecipeError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, EOFError) as error:
        raise RecipeError(f"isn't a height map that can be read ({error})", where=path) from None


def _csv(path: Path) -> HeightMap:
    text = path.read_text(encoding="utf-8", errors="replace")
    lines = [line for line in text.splitlines() if line.strip() and line.lstrip()[0] not in "#%"]
    if not lines:
        raise RecipeError("is empty", where=path)
    if ";" in lines[-1]:
        split: Callable[[str], list[str]] = lambda line: line.replace(",", ".").split(";")  # noqa: E731
    elif "," in lines[-1]:
        split = lambda line: line.split(",")  # noqa: E731
    else:
        split = str.split
    rows = []
    for number, line in enumerate(lines):
        cells = [c.strip() for c in split(line)]
        if cells and cells[-1] == "":
            cells.pop()
        try:
            rows.append([_cell(c) for c in cells])
        except ValueError:
            if number == 0:
                continue  # names of the columns
            raise RecipeError(f"line {number + 1} holds something else than numbers", where=path) from None
    widths = {len(r) for r in rows}
    if len(widths) != 1:
        raise RecipeError("rows of different lengths", where=path, value=sorted(widths)[:4])
    values = np.array(rows, dtype=np.float64)
    if values.shape[1] == 3 and values.shape[0] > 30:
        return _gridded(values, path)
    if min(values.shape) < 2:
        raise RecipeError("needs at least 2 rows of 2 points", where=path, value=values.shape)
    return HeightMap(values=values)


def _cell(text: str) -> float:
    return float("nan") if text.lower() in ("", "nan", "na", "null", "***", "bad") else float(text)


def _npy(path: Path) -> HeightMap:
    values = np.load(path, allow_pickle=False)
    if values.ndim != 2 or values.dtype.kind not in "fiu":
        raise RecipeError("should hold one 2-D array of numbers", where=path, value=values.shape)
    return HeightMap(values=values.astype(np.float64))


def _tiff(path: Path) -> HeightMap:
    from PIL import Image, UnidentifiedImageError

    Image.MAX_IMAGE_PIXELS = None
    try:
        with Image.open(path) as image:
            values = np.asarray(image)
    except UnidentifiedImageError:
        raise RecipeError("isn't a TIFF image", where=path) from None
    if values.ndim != 2:
        raise RecipeError("should hold one grey channel", where=path, value=values.shape)
    return HeightMap(values=values.astype(np.float64))


PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


def _ply(path: Path) -> HeightMap:
    data = path.read_bytes()
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise RecipeError("isn't a PLY file", where=path)
    header = data[:end].decode("latin-1").splitlines()
    body = data[data.index(b"\n", end) + 1 :]
    kind, count, names, types, inside = "", 0, [], [], False
    shape: dict[str, int] = {}
    for line in header:
        words = line.split()
        if not words:
            continue
        if words[0] == "format":
            kind = words[1]
        elif words[0] == "element":
            inside = words[1] == "vertex"
            count = int(words[2]) if inside else count
        elif words[0] == "property" and inside:
            if words[1] == "list":
                raise RecipeError("has lists in its vertices", where=path)
            names.append(words[2])
            types.append(PLY_TYPES[words[1]])
        elif words[0] in ("obj_info", "comment") and len(words) >= 3:
            found = re.match(r"(num_)?(cols|columns|width|rows|height)$", words[1])
            if found and words[2].isdigit():
                shape["m" if found[2] in ("cols", "columns", "width") else "n"] = int(words[2])
    if kind == "ascii":
        flat = np.array(body.split()[: count * len(names)], dtype=np.float64).reshape(count, -1)
        table = {name: flat[:, k] for k, name in enumerate(names)}
    else:
        order = "<" if kind == "binary_little_endian" else ">"
        record = np.dtype([(n, order + t) for n, t in zip(names, types, strict=True)])
        read = np.frombuffer(body, dtype=record, count=count)
        table = {name: read[name].astype(np.float64) for name in names}
    return _organised(table, shape.get("n"), shape.get("m"), path)


def _pcd(path: Path) -> HeightMap:
    data = path.read_bytes()
    found = re.search(rb"^DATA (\S+)\s*?\n", data, re.MULTILINE)
    if found is None:
        raise RecipeError("isn't a PCD file", where=path)
    header = {
        line.split()[0]: line.split()[1:]
        for line in data[: found.start()].decode("latin-1").splitlines()
        if line.strip() and not line.startswith("#")
    }
    names = header["FIELDS"]
    width, height = int(header["WIDTH"][0]), int(header.get("HEIGHT", ["1"])[0])
    body, kind = data[found.end() :], found[1].decode()
    if kind == "ascii":
        flat = np.array(body.split(), dtype=np.float64).reshape(width * height, -1)
        table = {name: flat[:, k] for k, name in enumerate(names)}
    elif kind == "binary":
        letter = {"F": "f", "I": "i", "U": "u"}
        record = np.dtype(
            [(n, "<" + letter[t] + s) for n, t, s in zip(names, header["TYPE"], header["SIZE"], strict=True)]
        )
        read = np.frombuffer(body, dtype=record, count=width * height)
        table = {name: read[name].astype(np.float64) for name in names}
    else:
        raise RecipeError("compressed PCD isn't read", where=path, allowed="DATA ascii or binary")
    return _organised(table, height, width, path)


def _organised(
    table: dict[str, Floats], rows: int | None, columns: int | None, path: Path
) -> HeightMap:
    """Bring points to a grid, by their order where the file says how many, else by place."""
    x, y, z = (table[k] for k in ("x", "y", "z"))
    if rows and columns and rows > 1 and rows * columns == x.size:
        grids = [v.reshape(rows, columns) for v in (x, y, z)]
        with np.errstate(invalid="ignore"):
            column_x = np.nanmedian(grids[0], axis=0)
            row_y = np.nanmedian(grids[1], axis=1)
        pitch_x = float(np.nanmedian(np.diff(column_x)))
        pitch_y = float(np.nanmedian(np.diff(row_y)))
        away = np.nanmax(np.abs(grids[0] - column_x))
        if not away < 0.2 * abs(pitch_x):
            raise RecipeError("its columns aren't straight: not a rectified height map", where=path)
        intensity = next(
            (table[k] for k in ("intensity", "scalar_intensity", "gray") if k in table), None
        )
        return HeightMap(
            values=grids[2],
            intensity=None if intensity is None else _unit(intensity.reshape(rows, columns)),
            pitch_x=pitch_x,
            pitch_y=pitch_y,
            origin_x=float(column_x[np.isfinite(column_x)][0]),
        )
    return _gridded(np.stack([x, y, z], axis=1), path)


def _gridded(points: Floats, path: Path) -> HeightMap:
    """Sort points of a regular x-y grid into it; a point off the grid is an error."""
    points = points[np.isfinite(points[:, :2]).all(axis=1)]
    axes = []
    for k in range(2):
        values = np.unique(np.round(points[:, k], 9))
        step = float(np.median(np.diff(values))) if values.size > 1 else 0.0
        if step <= 0:
            raise RecipeError("points don't form a grid", where=path)
        index = (points[:, k] - values[0]) / step
        if np.abs(index - np.rint(index)).max() > 0.1:
            raise RecipeError(
                "points don't lie on a regular grid, and readings are never resampled", where=path
            )
        axes.append((np.rint(index).astype(int), float(values[0]), step))
    (column, x0, dx), (row, _, dy) = axes
    size = (int(row.max()) + 1, int(column.max()) + 1)
    if size[0] * size[1] > 20 * len(points) + 1000:
        raise RecipeError("points don't fill a grid", where=path, value=size)
    values = np.full(size, np.nan)
    values[row, column] = points[:, 2]
    return HeightMap(values=values, pitch_x=dx, pitch_y=dy, origin_x=x0)


def _sick(path: Path) -> HeightMap:
    content = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(content, list):
        raise RecipeError("isn't a list of images as SICK's AppSpace writes it", where=path)
    images = [o["data"] for o in content if o.get("class") != "SensorData"]
    if not images:
        raise RecipeError("holds no image", where=path)
    first = images[0]
    raw = _pixels(first)
    size, origin = first["PixelSize"], first["Origin"]
    values = raw.astype(np.float64) * size["z"] + origin["z"]
    if first.get("HandleZeroPixels") == "MissingData":
        values[raw == 0] = np.nan
    brightness = _pixels(images[1]) if len(images) > 1 else None
    return HeightMap(
        values=values,
        intensity=None if brightness is None else _unit(brightness.astype(np.float64)),
        pitch_x=float(size["x"]),
        pitch_y=float(size["y"]),
        origin_x=float(origin["x"]),
        unit_mm=1.0,
        rows=_encoder(content, raw.shape[0]),
    )


def _pixels(image: dict[str, Any]) -> NDArray[Any]:
    data = image["Data"]
    pixels = data["Pixels"]
    kind = np.dtype(pixels["elemTypes"][0]).newbyteorder(
        ">" if pixels.get("endian") == "big" else "<"
    )
    try:
        raw = base64.b64decode(pixels["data"], validate=True)
    except binascii.Error:
        raise ValueError("pixel data isn't base64") from None
    return np.frombuffer(raw, dtype=kind).reshape(int(data["Height"]), int(data["Width"]))


def _encoder(content: list[dict[str, Any]], rows: int) -> Floats | None:
    for entry in content:
        if entry.get("class") != "SensorData":
            continue
        for item in entry["data"].get("MetaData", {}).get("data", {}).get("Content", []):
            if item.get("Key") == "EncoderValue" and len(item.get("Value", [])) == rows:
                return np.array(item["Value"], dtype=np.float64)
    return None


def _unit(values: Floats) -> Floats:
    """Bring brightness to 0..1 by the range of its type."""
    top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
    scale = next((s for s in (1.0, 255.0, 1023.0, 4095.0, 65535.0) if top <= s), top)
    return np.asarray(values / scale)


READERS: dict[str, Callable[[Path], HeightMap]] = {
    ".csv": _csv, ".txt": _csv, ".npy": _npy, ".tif": _tiff, ".tiff": _tiff, ".ply": _ply,
    ".pcd": _pcd, ".json": _sick,
}  # fmt: skip
