"""PLY point clouds: text or binary, in order (range grids, or rows and columns named) or not."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats.clouds.cloud import Cloud, brightness, to_height_map
from sensors.formats.height_map import Floats, HeightMap, scale_mm

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
BRIGHT = ("intensity", "scalar_intensity", "reflectance", "scalar_Intensity", "gray", "grey")


def read_ply(path: Path, unit: str | None) -> HeightMap:
    """Read the vertices as a height map; `unit` is that of x, y and z."""
    blob = path.read_bytes()
    if not blob.startswith(b"ply"):
        raise RecipeError("isn't a PLY file", where=path)
    try:
        return _read(blob, path, unit)
    except (KeyError, ValueError, IndexError, UnicodeDecodeError) as error:
        if isinstance(error, RecipeError):
            raise
        raise RecipeError(f"is a damaged PLY file ({error})", where=path) from None


def _read(blob: bytes, path: Path, unit: str | None) -> HeightMap:
    end = blob.index(b"end_header")
    start = blob.index(b"\n", end) + 1
    order, elements, words = "", [], {}
    element: list[Any] = []
    for line in blob[:end].decode("ascii", "replace").splitlines()[1:]:
        part = line.split()
        if not part:
            continue
        if part[0] == "format":
            order = ORDERS[part[1]]
        elif part[0] == "element":
            element = [part[1], int(part[2]), []]
            elements.append(element)
        elif part[0] == "property":
            element[2].append((part[-1], part[1:-1]))
        elif part[0] in ("obj_info", "comment") and len(part) >= 3:
            words[part[1].rstrip(":=").lower()] = part[2]
    body = _Body(blob[start:], order)
    vertex: dict[str, Floats] = {}
    index: NDArray[np.int64] | None = None
    for name, count, properties in elements:
        if name == "vertex":
            vertex = body.table(count, properties)
        elif name == "range_grid" and vertex:
            index = body.first_of_lists(count, properties)
        elif vertex:
            break
        else:
            raise RecipeError("holds an element before its vertices", where=path, value=name)
    if not {"x", "y", "z"} <= set(vertex):
        raise RecipeError("has no vertices with x, y and z", where=path)
    points = np.stack([vertex[k] for k in "xyz"], axis=1) * scale_mm(unit)
    bright = next((brightness(vertex[k]) for k in BRIGHT if k in vertex), None)
    shape = _shape(words, len(points) if index is None else len(index))
    if index is not None:
        filled = np.where(index >= 0, index, 0)
        points = np.where(index[:, None] >= 0, points[filled], np.nan)
        bright = None if bright is None else np.where(index >= 0, bright[filled], 0.0)
    return to_height_map(Cloud(points_mm=points, shape=shape, intensity=bright), path)


def _shape(words: dict[str, str], count: int) -> tuple[int, int] | None:
    for columns, rows in (("num_cols", "num_rows"), ("width", "height"), ("columns", "rows")):
        if words.get(columns, "").isdigit() and words.get(rows, "").isdigit():
            shape = int(words[rows]), int(words[columns])
            if shape[0] * shape[1] == count:
                return shape
    return None


class _Body:
    """What follows the header, read front to back."""

    def __init__(self, blob: bytes, order: str) -> None:
        self.blob, self.order, self.at = blob, order, 0
        self.words = [] if order else blob.split()

    def table(self, count: int, properties: list[tuple[str, list[str]]]) -> dict[str, Floats]:
        """Read an element without lists as columns."""
        if any(kinds[0] == "list" for _, kinds in properties):
            raise RecipeError("PLY vertices with lists can't be read")
        if not self.order:
            taken = self.words[self.at : self.at + count * len(properties)]
            if len(taken) < count * len(properties):
                raise ValueError(f"ends early, {count} vertices are announced")
            self.at += len(taken)
            values = np.array(taken, dtype=np.float64).reshape(count, -1)
            return {name: values[:, k] for k, (name, _) in enumerate(properties)}
        dtype = np.dtype([(name, self.order + TYPES[kinds[0]]) for name, kinds in properties])
        if len(self.blob) - self.at < count * dtype.itemsize:
            raise ValueError(f"ends early, {count} vertices are announced")
        rows = np.frombuffer(self.blob, dtype=dtype, count=count, offset=self.at)
        self.at += count * dtype.itemsize
        return {name: np.asarray(rows[name], dtype=np.float64) for name, _ in properties}

    def first_of_lists(
        self, count: int, properties: list[tuple[str, list[str]]]
    ) -> NDArray[np.int64]:
        """Read an element that is one list; its first entry, -1 where it is empty."""
        if count > len(self.blob):  # an entry takes a byte at least
            raise ValueError(f"ends early, {count} entries are announced")
        (_, kinds) = properties[0]
        found = np.full(count, -1, dtype=np.int64)
        size, entry = (np.dtype((self.order or "<") + TYPES[kind]) for kind in kinds[1:3])
        for k in range(count):
            if not self.order:
                length = int(self.words[self.at])
                if length:
                    found[k] = int(self.words[self.at + 1])
                self.at += 1 + length
            else:
                length = int(np.frombuffer(self.blob, size, 1, self.at)[0])
                if length:
                    found[k] = np.frombuffer(self.blob, entry, 1, self.at + size.itemsize)[0]
                self.at += size.itemsize + length * entry.itemsize
        return found
