"""Shards on disk: labelled scans in HDF5, scans along the first axis of every dataset.

A shard is written aside, synced and renamed, and known by its SHA-256; nothing in it depends on
the clock, the machine's name or the number of workers.
"""

import hashlib
import json
import math
import os
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from files.hdf5_output import Output
from files.place import reading, source
from files.whole_file import sync
from pipeline.dataset.chunks import deflated
from pipeline.dataset.compression import NEEDS, Compression, filters, opened, reader_needs

if TYPE_CHECKING:
    from pipeline.scan.labelled_scan import Scan
    from sensors.datasheet import Datasheet

FORMAT, VERSION = "flawforge-shard", 1
FINE_MM = 1e-4  # ideal and clean depths: counts of 0.1 µm
CHUNK_BYTES = 1 << 20
CHECKED = (  # what a scan's checksum is made of, in this order
    "depth", "depth_ideal", "depth_clean", "mask", "mask_visible", "invalid_reason", "instance",
    "pose", "pose_true", "time", "ray_x_mm", "ray_slope", "points_part", "intensity",
)  # fmt: skip


class DepthCode:
    """Depths as counts: depth = offset + scale * count; the largest count is a missing reading.

    Parameters
    ----------
    scale_mm : float
        Size of a count, mm.
    depth_min_mm, depth_max_mm : float
        What must be held, mm.
    """

    def __init__(self, scale_mm: float, depth_min_mm: float, depth_max_mm: float) -> None:
        self.scale_mm = scale_mm
        self.first = math.ceil(depth_min_mm / scale_mm - 1e-9)
        span = (depth_max_mm - depth_min_mm) / scale_mm
        kind = np.uint16 if span < np.iinfo(np.uint16).max else np.uint32
        self.dtype: np.dtype[Any] = np.dtype(kind)
        self.missing = int(np.iinfo(kind).max)

    @property
    def offset_mm(self) -> float:
        """Depth of count 0, mm."""
        return self.first * self.scale_mm

    def encode(self, depth_mm: NDArray[np.float64]) -> NDArray[np.unsignedinteger[Any]]:
        """Turn depths in mm (NaN = missing) into counts."""
        from pipeline.scan.labels import counts_of

        counts = np.empty(depth_mm.shape, dtype=self.dtype)
        counts_of(depth_mm, self.scale_mm, self.first, self.missing, counts)
        return counts


class ShardWriter:
    """Writes one shard scan by scan, with memory for one scan; a context manager.

    Without an exception the shard gets its final name; otherwise no file remains.
    """

    def __init__(
        self,
        path: Path,
        *,
        datasheet: "Datasheet",
        shape: tuple[int, int, int],
        attributes: Mapping[str, Any],
        with_points: bool = False,
        with_intensity: bool = False,
        compression: Compression = "deflate",
    ) -> None:
        # what simulates is loaded here: who reads a shard does without
        from pipeline.scan.labelled_scan import CLASS_NAMES, REASON_NAMES

        self.path = path
        self._aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}.part")
        self._count = 0
        self._ids: list[str] = []
        self._compression = compression
        self._filters = filters(compression)
        low, high = datasheet.depth_min_mm, datasheet.depth_max_mm
        self._reading = DepthCode(datasheet.step_mm, low, high) if datasheet.step_mm else None
        self._fine = DepthCode(FINE_MM, low, high)
        self._datasets: dict[str, Any] = {}
        self._output = Output(self._aside)
        self._file = h5py.File(self._output, "w", libver="v110")
        for key, value in attributes.items():
            self._file.attrs[key] = value if isinstance(value, str) else json.dumps(value)
        if (needed := reader_needs(compression)) is not None:
            self._file.attrs[NEEDS] = needed
        self._file.attrs["format"] = FORMAT
        self._file.attrs["version"] = VERSION
        self._file.attrs["classes"] = json.dumps(CLASS_NAMES)
        self._file.attrs["invalid_reasons"] = json.dumps(REASON_NAMES)
        self._file.attrs["units"] = "mm, s; point = (ray_x_mm + depth * ray_slope, 0, depth)"
        scans, profiles, points = shape
        grid = (profiles, points)
        self._make("depth", scans, grid, self._reading.dtype if self._reading else np.float32)
        self._note_code("depth", self._reading)
        for name in ("depth_ideal", "depth_clean"):
            self._make(name, scans, grid, self._fine.dtype)
            self._note_code(name, self._fine)
        for name in ("mask", "mask_visible", "invalid_reason"):
            self._make(name, scans, grid, np.uint8)
        self._make("instance", scans, grid, np.uint16)
        for name in ("pose", "pose_true"):
            self._make(name, scans, (profiles, 4, 4), np.float64)
        self._make("time", scans, (profiles,), np.float64)
        for name in ("ray_x_mm", "ray_slope"):
            self._make(name, scans, (points,), np.float64)
        if with_points:
            self._make("points_part", scans, (*grid, 3), np.float32)
        if with_intensity:
            self._make("intensity", scans, grid, np.uint8)

    def _make(self, name: str, scans: int, shape: tuple[int, ...], dtype: Any) -> None:
        row_bytes = int(np.prod(shape[1:], dtype=np.int64)) * np.dtype(dtype).itemsize
        rows = min(shape[0], max(1, CHUNK_BYTES // row_bytes))
        self._datasets[name] = self._file.create_dataset(
            name,
            shape=(scans, *shape),
            maxshape=(scans, *shape),
            dtype=dtype,
            chunks=(1, rows, *shape[1:]),
            **self._filters,
        )

    def _note_code(self, name: str, code: DepthCode | None) -> None:
        attributes = self._datasets[name].attrs
        if code is not None:
            attributes["scale_mm"] = code.scale_mm
            attributes["offset_mm"] = code.offset_mm
            attributes["missing"] = code.missing

    def add(self, scan_id: str, scan: "Scan") -> str:
        """Append a scan and return the SHA-256 of its arrays."""
        reading = self._reading
        codes = {"depth": reading, "depth_ideal": self._fine, "depth_clean": self._fine}
        arrays: dict[str, NDArray[Any]] = {
            "depth": scan.depth_mm,
            "depth_ideal": scan.depth_ideal_mm,
            "depth_clean": scan.depth_clean_mm,
            "mask": scan.mask,
            "mask_visible": scan.mask_visible,
            "invalid_reason": scan.invalid_reason,
            "instance": scan.instance,
            "pose": scan.poses,
            "pose_true": scan.poses_true,
            "time": scan.time_s,
            "ray_x_mm": scan.laser.x_mm,
            "ray_slope": scan.laser.slope_x,
        }
        if "points_part" in self._datasets:
            arrays["points_part"] = scan.points_part_mm().astype(np.float32)
        if scan.intensity is not None:
            arrays["intensity"] = scan.intensity
        digest = hashlib.sha256()
        for name in CHECKED:
            if name in arrays:
                dataset = self._datasets[name]
                for first, part in _chunks(arrays[name], dataset, codes.get(name)):
                    digest.update(part.data)
                    self._write(dataset, first, part)
                # now, not when the last reference goes: a debugger or Dask's profiler may hold one
                dataset.flush()
                self._output.check()
        self._ids.append(scan_id)
        self._count += 1
        return digest.hexdigest()

    def _write(self, dataset: Any, first: int, part: NDArray[Any]) -> None:
        """Write a chunk of a scan from row `first` on; counts all 0 need no place on disk."""
        if part.dtype.kind == "u" and not part.any():
            return
        if self._compression == "deflate":
            place = (self._count, first) + (0,) * (part.ndim - 1)
            dataset.id.write_direct_chunk(place, deflated(part, dataset.chunks[1]))
        else:
            dataset[self._count, first : first + len(part)] = part

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                for dataset in self._file.values():
                    dataset.resize(self._count, axis=0)
                width = max([len(name.encode()) for name in self._ids], default=1)
                names = np.array([name.encode() for name in self._ids], dtype=f"S{width}")
                self._file.create_dataset("scan_id", data=names)
                self._output.check()
            self._file.close()
            self._output.close()
            if kind is None:
                self._output.check()
                sync(self._aside)
                os.replace(self._aside, self.path)
                sync(self.path.parent)
        finally:
            self._file.close()
            self._output.close()
            self._aside.unlink(missing_ok=True)


def _chunks(
    values: NDArray[Any], dataset: Any, code: DepthCode | None
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Give a scan's values as they are stored, chunk by chunk, and the first row of each."""
    rows = dataset.chunks[1]
    for first in range(0, len(values), rows):
        part = values[first : first + rows]
        if code is not None:
            part = code.encode(part)
        yield first, np.ascontiguousarray(part, dtype=dataset.dtype)


def read_scan(path: Path, row: int) -> dict[str, Any]:
    """Read one scan of a shard: depths in mm with NaN for missing, the rest as stored."""
    with opened(path) as file:
        found: dict[str, Any] = {}
        for name, dataset in file.items():
            values = dataset[row]
            if "scale_mm" in dataset.attrs:
                scale, offset = dataset.attrs["scale_mm"], dataset.attrs["offset_mm"]
                missing = values == dataset.attrs["missing"]
                values = np.where(missing, np.nan, offset + values.astype(np.float64) * scale)
            found[name] = values.decode() if isinstance(values, bytes) else values
        return found


def reason_names(path: Path) -> dict[int, str]:
    """Return the names of the reasons of missing readings, by number, as a shard states them."""
    with h5py.File(source(path), "r") as file:
        named: dict[str, str] = json.loads(str(file.attrs["invalid_reasons"]))
    return {int(number): name for number, name in named.items()}


def scan_checksums(path: Path) -> dict[str, str]:
    """SHA-256 of the arrays of each scan in a shard, by scan id, as `ShardWriter.add` gave it."""
    sums = {}
    with opened(path) as file:
        for row, scan_id in enumerate(file["scan_id"][:]):
            digest = hashlib.sha256()
            for name in CHECKED:
                if name in file:
                    digest.update(np.ascontiguousarray(file[name][row]).data)
            sums[scan_id.decode()] = digest.hexdigest()
    return sums


def scans_in(path: Path) -> list[str]:
    """Return the ids of a shard's scans, in order; they are never compressed."""
    with h5py.File(source(path), "r") as file:
        return [scan_id.decode() for scan_id in file["scan_id"][:]]


def pixels_in(path: Path) -> dict[tuple[str, int], int]:
    """Count the points of each flaw in each scan of a shard, by scan id and instance."""
    found: dict[tuple[str, int], int] = {}
    with opened(path) as file:
        for row, scan_id in enumerate(file["scan_id"][:]):
            counts = np.bincount(file["instance"][row].ravel())
            for number in np.flatnonzero(counts[1:]) + 1:
                found[scan_id.decode(), int(number)] = int(counts[number])
    return found


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, as hex."""
    with reading(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
