"""X3P: topographies of ISO 25178-72 (ISO 5436-2), a zip of XML and binary, lengths in metres."""

import hashlib
import zipfile
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from files.budget import check_archive
from files.errors import RecipeError
from sensors.formats.height_map import Floats, HeightMap

TYPES = {"I": "<i2", "L": "<i4", "F": "<f4", "D": "<f8"}
MM = 1000.0


def read_x3p(path: Path, unit: str | None) -> HeightMap:
    """Read a profile or surface on even axes. The format's unit is the metre.

    Raises
    ------
    RecipeError
        Where the file is damaged, or its points stand on no even grid.
    """
    if unit not in (None, "m"):
        raise RecipeError("is in metres by its standard", where=path, value=unit, allowed="m")
    try:
        with zipfile.ZipFile(path) as archive:
            check_archive(archive, path)
            root = ElementTree.fromstring(_member(archive, "main.xml"))
            return _read(_Record(root), archive, path)
    except (zipfile.BadZipFile, zlib.error, ElementTree.ParseError, KeyError, OSError) as error:
        raise RecipeError(f"isn't an X3P file, or damaged ({error})", where=path) from None


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Read a member of the archive by its name, wherever its folder was packed."""
    names = archive.namelist()
    if name not in names:
        wanted = "/" + name.replace("\\", "/").lstrip("/").lower()
        ends = [one for one in names if ("/" + one.replace("\\", "/").lower()).endswith(wanted)]
        if len(ends) == 1:
            name = ends[0]
    return archive.read(name)


class _Record:
    """The texts of main.xml by path; tags without their namespace."""

    def __init__(self, root: ElementTree.Element) -> None:
        for element in root.iter():
            element.tag = element.tag.rsplit("}", 1)[-1]
        self.root = root

    def text(self, at: str, default: str = "") -> str:
        return (self.root.findtext(at) or default).strip()

    def number(self, at: str, default: float, path: Path) -> float:
        text = self.text(at)
        try:
            return float(text) if text else default
        except ValueError:
            raise RecipeError(f"{at} isn't a number", where=path, value=text) from None


def _read(record: _Record, archive: zipfile.ZipFile, path: Path) -> HeightMap:
    feature = record.text("Record1/FeatureType")
    if feature not in ("SUR", "PRF"):
        raise RecipeError("holds no grid", where=path, value=feature, allowed="SUR, PRF")
    for axis in ("CX", "CY"):
        kind = record.text(f"Record1/Axes/{axis}/AxisType", "I")
        if kind != "I" and not (axis == "CY" and feature == "PRF"):
            raise RecipeError(f"has points unevenly spaced along {axis}", where=path, value=kind)
    at = "Record3/MatrixDimension/Size"
    columns, rows, layers = (int(record.number(at + axis, 1, path)) for axis in "XYZ")
    if layers != 1 or columns < 1 or rows < 1:
        raise RecipeError("isn't one layer", where=path, value=f"{columns} × {rows} × {layers}")
    kind = record.text("Record1/Axes/CZ/DataType")
    raw = _points(record, archive, path, (rows, columns), kind)
    step = record.number("Record1/Axes/CZ/Increment", 1.0, path)
    readings = raw * step + record.number("Record1/Axes/CZ/Offset", 0.0, path)
    link = record.text("Record3/DataLink/ValidPointsLink")
    if link:
        bits = np.unpackbits(np.frombuffer(_member(archive, link), np.uint8), bitorder="little")
        if bits.size < readings.size:
            raise RecipeError("has too few bits in its list of valid points", where=path)
        readings[bits[: readings.size].reshape(readings.shape) == 0] = np.nan

    def places(axis: str, count: int) -> Floats:
        pitch = record.number(f"Record1/Axes/{axis}/Increment", 1.0, path)
        offset = record.number(f"Record1/Axes/{axis}/Offset", 0.0, path)
        return (offset + np.arange(count, dtype=np.float64) * pitch) * MM

    maker = [record.text(f"Record2/Instrument/{k}") for k in ("Manufacturer", "Model")]
    return HeightMap(
        readings_mm=readings * MM,
        x_mm=places("CX", columns),
        y_mm=places("CY", rows) if rows > 1 else None,
        step_mm=step * MM if kind in ("I", "L") else None,
        note=" ".join(["X3P", *(word for word in maker if word)]),
    )


def _points(
    record: _Record, archive: zipfile.ZipFile, path: Path, shape: tuple[int, int], kind: str
) -> Floats:
    link = record.text("Record3/DataLink/PointDataLink")
    if not link:
        texts = [(e.text or "").strip() for e in record.root.findall("Record3/DataList/Datum")]
        try:  # one point each: "x;y;z", the last is the height; empty = missing
            values = np.array([float(t.split(";")[-1]) if t else np.nan for t in texts])
        except ValueError as error:
            raise RecipeError(f"has a datum that isn't a number ({error})", where=path) from None
        if values.size != shape[0] * shape[1]:
            raise RecipeError("has another number of points than it announces", where=path)
        return values.reshape(shape)
    if kind not in TYPES:
        raise RecipeError("has heights of an unknown type", where=path, value=kind, allowed="ILFD")
    blob = _member(archive, link)
    wanted = shape[0] * shape[1] * np.dtype(TYPES[kind]).itemsize
    if len(blob) != wanted:
        raise RecipeError(
            f"announces {shape[0]} × {shape[1]} points and holds another number of bytes",
            where=path,
            value=len(blob),
            allowed=str(wanted),
        )
    checksum = record.text("Record3/DataLink/MD5ChecksumPointData")
    if checksum and hashlib.md5(blob, usedforsecurity=False).hexdigest() != checksum.lower():
        raise RecipeError("is damaged: its points don't match their checksum", where=path)
    return np.frombuffer(blob, dtype=TYPES[kind]).astype(np.float64).reshape(shape)
