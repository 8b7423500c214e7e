"""SDF: surface data files of ISO 25178-71, text or binary, lengths in metres."""

import re
from pathlib import Path

import numpy as np

from files.errors import RecipeError
from sensors.formats.height_map import Floats, HeightMap, scale_mm, unit_decision
from sensors.formats.text.decode import decoded

HEAD = {
    "ManufacID": 10, "CreateDate": 12, "ModDate": 12, "NumPoints": 2, "NumProfiles": 2,
    "Xscale": 8, "Yscale": 8, "Zscale": 8, "Zresolution": 8, "Compression": 1, "DataType": 1,
    "CheckType": 1,
}  # fmt: skip
"""Fields of the binary header and their bytes, in order (ISO 25178-71, table 1)."""
TYPES = {3: "<f4", 5: "<i2", 6: "<i4", 7: "<f8"}
WHOLE = (5, 6)
MISSING = ("BAD", "NAN")


def read_sdf(path: Path, unit: str | None) -> HeightMap:
    """Read heights; the file states scales, `unit` overrides that of heights."""
    blob = path.read_bytes()
    if blob[:8].strip(b"\0 ") == b"bISO-1.0":
        head, values = _binary(blob, path)
    else:
        head, values = _text(decoded(blob), path)
    points, profiles = int(_real(head, "NumPoints", path)), int(_real(head, "NumProfiles", path))
    if points < 1 or profiles < 1 or values.size < points * profiles:
        raise RecipeError(
            f"announces {profiles} × {points} points and ends early", where=path, value=values.size
        )
    metre = 1e3
    z_scale = _real(head, "Zscale", path)
    scale = z_scale * metre if unit is None else scale_mm(unit)
    resolution = _real(head, "Zresolution", path)
    x_pitch, y_pitch = (_real(head, f"{axis}scale", path) * metre for axis in "XY")
    # A negative resolution means that it is unknown.
    step = resolution * metre if resolution > 0 and unit is None else None
    return HeightMap(
        readings_mm=values[: points * profiles].reshape(profiles, points) * scale,
        x_mm=np.arange(points, dtype=np.float64) * x_pitch,
        y_mm=np.arange(profiles, dtype=np.float64) * y_pitch if profiles > 1 else None,
        step_mm=step,
        note=f"SDF {head.get('ManufacID', '')}".strip(),
        unit_mm=scale,
        unit_stated=True,
        decisions=unit_decision(unit, "m" if unit is not None else None),
    )


def _binary(blob: bytes, path: Path) -> tuple[dict[str, str], Floats]:
    head: dict[str, str] = {}
    at = 8
    for key, size in HEAD.items():
        field = blob[at : at + size]
        if len(field) < size:
            raise RecipeError("ends within its header", where=path)
        kind = {2: "<u2", 8: "<f8", 1: "u1"}.get(size)
        head[key] = (
            field.decode("latin-1").strip("\0 ")
            if kind is None
            else repr(np.frombuffer(field, kind)[0].item())
        )
        at += size
    return head, _values(blob[at:], head, path)


def _values(body: bytes, head: dict[str, str], path: Path) -> Floats:
    kind = int(float(head["DataType"]))
    if int(float(head["Compression"])) != 0:
        raise RecipeError("is compressed", where=path, allowed="Compression = 0")
    if kind not in TYPES:
        raise RecipeError(
            "has readings of an unknown type", where=path, value=kind,
            allowed=", ".join(str(key) for key in TYPES),
        )  # fmt: skip
    dtype = np.dtype(TYPES[kind])
    count = int(float(head["NumPoints"])) * int(float(head["NumProfiles"]))
    raw = np.frombuffer(body[: count * dtype.itemsize], dtype) if len(body) >= (
        count * dtype.itemsize
    ) else np.zeros(0, dtype)  # fmt: skip
    values = raw.astype(np.float64)
    if kind in WHOLE:  # the least value stands for a missing point
        values[raw == np.iinfo(dtype).min] = np.nan
    values[~np.isfinite(values)] = np.nan
    return values


def _text(text: str, path: Path) -> tuple[dict[str, str], Floats]:
    if not text.lstrip().startswith("aISO-1.0"):
        raise RecipeError("isn't an SDF file", where=path, allowed="aISO-1.0 or bISO-1.0")
    head_text, star, body = text.partition("\n*")
    if not star:
        raise RecipeError("ends within its header", where=path)
    head = {
        key.strip(): value.strip()
        for key, _, value in (line.partition("=") for line in head_text.splitlines()[1:])
    }
    body = body.partition("*")[0]
    words = re.split(r"[\s,;]+", body.strip())
    try:
        values = [np.nan if word.upper() in MISSING else float(word) for word in words if word]
    except ValueError as error:
        raise RecipeError(f"has a reading that isn't a number ({error})", where=path) from None
    return head, np.array(values, np.float64)


def _real(head: dict[str, str], key: str, path: Path) -> float:
    try:
        value = float(head[key])
    except (KeyError, ValueError):
        raise RecipeError(f"states no {key}", where=path, value=head.get(key)) from None
    if not np.isfinite(value):
        raise RecipeError(f"states no {key}", where=path, value=value)
    return value
