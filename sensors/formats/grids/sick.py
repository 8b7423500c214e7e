"""SICK AppSpace height maps: JSON with a height image, a reflectance image and each row's encoder.

Heights are `raw * PixelSize.z + Origin.z`, mm; a raw 0 is a missing point.
"""

import base64
import binascii
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats.height_map import Floats, HeightMap, scale_mm

TYPES = {
    "uint8": "u1", "int8": "i1", "uint16": "u2", "int16": "i2", "uint32": "u4", "int32": "i4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"big": ">", "little": "<", "neutral": "|"}


def read_sick(path: Path, unit: str | None) -> HeightMap:
    """Read the first height image, the reflectance that belongs to it and the encoder.

    Rows without encoder values follow each other at the file's pixel size.
    """
    try:
        entries = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise RecipeError(f"isn't JSON, or cut short ({error})", where=path) from None
    try:
        return _read(entries if isinstance(entries, list) else [entries], path, unit)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise RecipeError(f"isn't a SICK height map (no {error})", where=path) from None


def _read(entries: list[Any], path: Path, unit: str | None) -> HeightMap:
    images = [entry["data"] for entry in entries if entry.get("class") != "SensorData"]
    heights = [image for image in images if image["Data"]["ImageType"] != "uint8"]
    if not heights:
        raise RecipeError("holds no height image", where=path)
    image = heights[0]
    size, origin, scale = image["PixelSize"], image["Origin"], scale_mm(unit)
    raw = _pixels(image, path)
    readings = (raw * float(size["z"]) + float(origin["z"])) * scale
    if image.get("HandleZeroPixels") == "MissingData":
        readings[raw == 0] = np.nan
    rows, columns = readings.shape
    whole = raw.dtype.kind in "iu"
    encoder, note = _encoder(entries, rows, path)
    along = np.arange(rows, dtype=np.float64) * float(size["y"])
    if encoder is not None:
        counts = np.diff(encoder)
        moving = counts[counts != 0]
        if moving.size:  # the pixel size is the travel between two rows
            along = (encoder - encoder[0]) * float(size["y"]) / abs(float(np.median(moving)))
    return HeightMap(
        readings_mm=readings,
        x_mm=(float(origin["x"]) + np.arange(columns, dtype=np.float64) * float(size["x"])) * scale,
        y_mm=(float(origin["y"]) + along) * scale,
        intensity=_reflectance(images, readings.shape, path),
        step_mm=float(size["z"]) * scale if whole else None,
        note=note,
    )


def _reflectance(images: list[Any], shape: tuple[int, ...], path: Path) -> Floats | None:
    for image in images:
        data = image["Data"]
        if data["ImageType"] == "uint8" and (data["Height"], data["Width"]) == shape:
            return _pixels(image, path) / 255.0
    return None


def _pixels(image: dict[str, Any], path: Path) -> NDArray[Any]:
    data = image["Data"]
    pixels = data["Pixels"]
    kind, endian = data["ImageType"], pixels["endian"]
    if kind not in TYPES or endian not in ORDERS:
        raise RecipeError(
            "has pixels of an unknown type",
            where=path,
            value=f"{kind}, {endian}",
            allowed=", ".join(TYPES),
        )
    try:
        blob = base64.b64decode(pixels["data"], validate=True)
    except (binascii.Error, ValueError) as error:
        raise RecipeError(f"has damaged pixel data ({error})", where=path) from None
    dtype = np.dtype(ORDERS[endian] + TYPES[kind])
    shape = int(data["Height"]), int(data["Width"])
    if len(blob) != shape[0] * shape[1] * dtype.itemsize:
        raise RecipeError(
            f"announces {shape[0]} × {shape[1]} pixels of {kind} and holds another number of bytes",
            where=path,
            value=len(blob),
            allowed=str(shape[0] * shape[1] * dtype.itemsize),
        )
    return np.frombuffer(blob, dtype=dtype).reshape(shape)


def _encoder(entries: list[Any], rows: int, path: Path) -> tuple[Floats | None, str]:
    for entry in entries:
        if entry.get("class") != "SensorData":
            continue
        note = f"SICK frame {entry['data'].get('FrameNo', '?')}"
        for item in entry["data"]["MetaData"]["data"]["Content"]:
            if item["Key"] == "EncoderValue":
                values = np.asarray(item["Value"], dtype=np.float64)
                if values.shape != (rows,):
                    raise RecipeError(
                        "EncoderValue doesn't fit the rows",
                        where=path,
                        value=values.shape,
                        allowed=str(rows),
                    )
                return values, note
        return None, note
    return None, "SICK height map"
