"""PCD point clouds (Point Cloud Library): text, binary, or compressed with LZF."""

import struct
from pathlib import Path

import numpy as np

from files.budget import allow
from files.errors import RecipeError
from sensors.formats.clouds.cloud import Cloud, brightness, to_height_map
from sensors.formats.height_map import Floats, HeightMap, scale_mm


def read_pcd(path: Path, unit: str | None) -> HeightMap:
    """Read the points as a height map; `unit` is that of x, y and z."""
    blob = path.read_bytes()
    try:
        return _read(blob, path, unit)
    except (KeyError, ValueError, IndexError, struct.error) as error:
        if isinstance(error, RecipeError):
            raise
        raise RecipeError(f"isn't a PCD file, or damaged ({error})", where=path) from None


def _read(blob: bytes, path: Path, unit: str | None) -> HeightMap:
    at = blob.index(b"\nDATA") + 1
    start = blob.index(b"\n", at) + 1
    lines = blob[:start].decode("ascii", "replace").splitlines()
    head = {part[0]: part[1:] for part in (line.split() for line in lines) if part}
    names = head["FIELDS"]
    counts = [int(c) for c in head.get("COUNT", ["1"] * len(names))]
    kinds = [
        {"F": "f", "I": "i", "U": "u"}[kind] + size
        for kind, size in zip(head["TYPE"], head["SIZE"], strict=True)
    ]
    columns, rows = int(head["WIDTH"][0]), int(head["HEIGHT"][0])
    count = columns * rows
    allow("readings", count, where=path)
    if "POINTS" in head and int(head["POINTS"][0]) != count:
        raise RecipeError("WIDTH × HEIGHT isn't POINTS", where=path, value=head["POINTS"][0])
    fields = [
        (name if repeat == 1 else f"{name}_", "<" + kind, (repeat,))
        for name, kind, repeat in zip(names, kinds, counts, strict=True)
    ]
    # "_" is padding and may stand more than once: number the fields
    numbered = [(f"{k}:{name}", *rest) for k, (name, *rest) in enumerate(fields)]
    dtype = np.dtype(numbered)
    table = _points(blob[start:], head["DATA"][0], dtype, count)
    values = {
        key.split(":", 1)[1]: np.asarray(table[key][:, 0], dtype=np.float64)
        for key in dtype.names or ()
    }
    if not {"x", "y", "z"} <= set(values):
        raise RecipeError("has no points with x, y and z", where=path)
    bright = next((values[k] for k in ("intensity", "i", "reflectance") if k in values), None)
    return to_height_map(
        Cloud(
            points_mm=np.stack([values[k] for k in "xyz"], axis=1) * scale_mm(unit),
            shape=(rows, columns) if rows > 1 else None,
            intensity=None if bright is None else brightness(bright),
        ),
        path,
    )


def _points(body: bytes, form: str, dtype: np.dtype[np.void], count: int) -> np.ndarray[
    tuple[int, ...], np.dtype[np.void]
]:  # fmt: skip
    if form == "ascii":
        words = np.array(body.split(), dtype=np.float64).reshape(count, -1)
        table = np.zeros(count, dtype=dtype)
        column = 0
        for key in dtype.names or ():
            width = table[key].shape[1]
            table[key] = words[:, column : column + width]
            column += width
        return table
    if form == "binary":
        if len(body) < count * dtype.itemsize:
            raise ValueError(f"ends early, {count} points are announced")
        return np.frombuffer(body, dtype=dtype, count=count)
    if form != "binary_compressed":
        raise ValueError(f"unknown DATA {form}")
    packed, size = struct.unpack_from("<II", body)
    if size != count * dtype.itemsize:
        raise ValueError(f"{size} bytes are announced for {count} points")
    if len(body) < 8 + packed:
        raise ValueError("ends early")
    raw = lzf_unpack(body[8 : 8 + packed], size)
    table = np.zeros(count, dtype=dtype)
    at = 0
    for key in dtype.names or ():  # one field after the other
        part: Floats = np.frombuffer(raw, table[key].dtype, table[key].size, at)
        table[key] = part.reshape(count, -1)
        at += part.nbytes
    return table


def lzf_unpack(packed: bytes, size: int) -> bytes:
    """Unpack LZF (Marc Lehmann's LibLZF): runs of literals, and copies of what came before."""
    out = bytearray()
    at = 0
    while at < len(packed):
        control = packed[at]
        at += 1
        if control < 32:
            out += packed[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += packed[at]
            at += 1
        back = ((control & 31) << 8) + packed[at] + 1
        at += 1
        if len(out) > size:
            raise ValueError("LZF gives more than is announced")
        if back > len(out):
            raise ValueError("LZF copies from before the start")
        length += 2
        while length > 0:  # a copy may overlap itself
            piece = out[len(out) - back : len(out) - back + min(length, back)]
            out += piece
            length -= len(piece)
    if len(out) != size:
        raise ValueError(f"LZF gives {len(out)} bytes, {size} are announced")
    return bytes(out)
