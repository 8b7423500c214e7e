"""SUR: Digital Surf's topographies, a header of 512 bytes and integers."""

import struct
import zlib
from pathlib import Path

import numpy as np

from files.errors import RecipeError
from sensors.formats.height_map import HeightMap, scale_mm

HEADER = 512
MIRROR_COLUMNS, MIRROR_ROWS = 2, 3  # of the inversion flag; 1, 2 and 3 invert the heights


def read_sur(path: Path, unit: str | None) -> HeightMap:
    """Read a profile or surface; the file states units, `unit` overrides that of heights."""
    blob = path.read_bytes()
    if blob[:12] not in (b"DIGITAL SURF", b"DSCOMPRESSED"):
        raise RecipeError("isn't a SUR file", where=path)
    if len(blob) < HEADER:
        raise RecipeError("ends within its header", where=path)

    def number(kind: str, at: int) -> int:
        return int(struct.unpack_from("<" + kind, blob, at)[0])

    def real(at: int) -> float:
        # the shortest decimal that the file's float32 stands for
        return float(str(np.float32(struct.unpack_from("<f", blob, at)[0])))

    def text(at: int, size: int) -> str:
        word = blob[at : at + size].split(b"\0")[0].decode("latin-1").strip()
        return word.replace("\xe6", "µ")  # the micro sign of MS-DOS

    kind, bits = number("h", 18), number("h", 98)
    if kind not in (1, 2):
        raise RecipeError("holds no profile and no surface", where=path, value=f"object {kind}")
    if bits not in (16, 32):
        raise RecipeError("has readings of an unknown size", where=path, value=f"{bits} bit")
    columns, rows = number("i", 108), number("i", 112)
    wanted = rows * columns * bits // 8
    start = HEADER + number("H", 334) + number("H", 336)
    body = _unpacked(blob[start:], path) if blob.startswith(b"DSC") else blob[start:]
    if columns < 1 or rows < 1 or len(body) < wanted:
        raise RecipeError(
            f"announces {rows} × {columns} readings and ends early",
            where=path,
            value=f"{len(body)} bytes",
            allowed=str(wanted),
        )
    raw = np.frombuffer(body[:wanted], dtype=f"<i{bits // 8}").reshape(rows, columns)
    scale = scale_mm(unit, text(196 + 16, 16))
    inversion = number("h", 290)
    sign = -1.0 if inversion in (1, MIRROR_COLUMNS, MIRROR_ROWS) else 1.0
    readings = sign * raw.astype(np.float64) * real(128) * scale + real(474) * scale
    if number("h", 86) == 1:
        readings[raw == number("i", 100) - 2] = np.nan
    if inversion == MIRROR_COLUMNS:
        readings = readings[:, ::-1]
    if inversion == MIRROR_ROWS:
        readings = readings[::-1]
    x_scale, y_scale = scale_mm(None, text(180, 16)), scale_mm(None, text(196, 16))
    return HeightMap(
        readings_mm=readings,
        x_mm=(real(466) + np.arange(columns, dtype=np.float64) * real(120)) * x_scale,
        y_mm=(real(470) + np.arange(rows, dtype=np.float64) * real(124)) * y_scale
        if rows > 1
        else None,
        step_mm=real(128) * scale,
        note=" ".join(f"SUR {text(20, 30)} {text(50, 30)}".split()),
    )


def _unpacked(body: bytes, path: Path) -> bytes:
    try:
        count = struct.unpack_from("<i", body)[0]
        sizes = struct.unpack_from(f"<{2 * count}i", body, 4)
        parts, at = [], 4 + 8 * count
        for packed in sizes[1::2]:
            parts.append(zlib.decompress(body[at : at + packed]))
            at += packed
    except (struct.error, zlib.error) as error:
        raise RecipeError(f"has damaged compressed readings ({error})", where=path) from None
    return b"".join(parts)
