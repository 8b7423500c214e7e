"""The manifest: a row for each scan, a row for each flaw in each scan, and the dataset's facts.

Written from the shards' journals one after the other, so that memory is independent of the
number of scans.
"""

import csv
import importlib.metadata
import json
import platform
from collections.abc import Iterable, Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np

from defects.kinds import KINDS
from files.whole_file import whole, write_whole
from pipeline.dataset.shortfalls import shortfalls
from pipeline.dataset.statistics import Statistics
from pipeline.scan.labelled_scan import CLASS_NAMES

LIBRARIES: Final = (
    "flawforge",
    "numpy",
    "scipy",
    "numba",
    "trimesh",
    "manifold3d",
    "embreex",
    "h5py",
    "deflate",
    "pyarrow",
)
SCAN_COLUMNS: Final = {
    "scan_id": str, "part": str, "specimen": str, "split": str, "split_by": str, "shard": str,
    "row": int, "seed": str, "sensor": str, "surface": str, "flaws": int, "flaws_seen": int,
    "flaws_visible": int, "flaws_detectable": int, "share_valid": float, "share_flaw": float,
    "depth_mean_mm": float, "length_mm": float, "speed_mm_s": float, "profile_rate_hz": float,
    "direction": float,
    "standoff_mm": float, "roll_deg": float, "pitch_deg": float, "yaw_deg": float,
    "start_x_mm": float, "start_y_mm": float, "start_z_mm": float, "aimed_at_flaw": float,
    "aimed_at_instance": int, "planned_pass": int, "planned_passes": int,
    "paths_drawn": int, "checksum": str,
}  # fmt: skip
FLAW_COLUMNS: Final = {
    "scan_id": str, "part": str, "instance": int, "kind": str, "class_id": int, "tier": str,
    "parameters": str, "seed": str, "position_x_mm": float, "position_y_mm": float,
    "position_z_mm": float, "normal_x": float, "normal_y": float, "normal_z": float,
    "removed_mm3": float, "added_mm3": float, "opening_mm2": float, "depth_mm": float,
    "pixels": int, "pixels_visible": int, "share_hidden": float, "deviation_over_noise": float,
    "specimen": str, "split": str, "snr": float, "response": float, "detectable": bool,
    "deviation_max_mm": float, "bbox_profile_first": int, "bbox_profile_end": int,
    "bbox_point_first": int, "bbox_point_end": int, "source": str,
    **{f"size_{size.name}": float for kind in KINDS.values() for size in kind.sizes()},
}  # fmt: skip
ROWS_AT_ONCE: Final = 20_000


def versions(further: Iterable[str] = ()) -> dict[str, str]:
    """Return versions of all packages that determine a shard's bytes, and of further ones."""
    found = {name: importlib.metadata.version(name) for name in (*LIBRARIES, *further)}
    return {"python": platform.python_version(), "machine": platform.machine(), **found}


def write_manifest(
    out: Path, *, journals: Iterable[Mapping[str, Any]], facts: Mapping[str, Any]
) -> dict[str, Any]:
    """Write manifest, flaws and dataset.json from the shards' journals; return the last.

    Parameters
    ----------
    out
        The dataset's folder.
    journals
        One for each shard, in order; each is read once and let go.
    facts
        What dataset.json says beside: name, recipe, versions, parts, what failed.
    """
    shards: dict[str, dict[str, Any]] = {}
    failed = list(facts["failed"])
    dropped: list[dict[str, str]] = []
    redrawn = 0
    statistics = Statistics(facts["recipe"]["splits"])
    scans_table = _Table(out / "manifest", SCAN_COLUMNS)
    with scans_table, _Table(out / "flaws", FLAW_COLUMNS) as flaws_table:
        for journal in journals:
            shards[journal["shard"]] = {
                "sha256": journal["sha256"],
                "scans": len(journal["scans"]),
                **_shard_statistics(journal),
            }
            failed.extend(journal["failed"])
            redrawn += journal["redrawn"]
            dropped.extend(journal["dropped"])
            for row in journal["scans"]:
                scans_table.add(row)
                statistics.add_scan(row)
            for row in journal["flaws"]:
                flaws_table.add(row)
                statistics.add_flaw(row)
    dataset: dict[str, Any] = {
        "format": "flawforge-dataset",
        "version": 1,
        **facts,
        "scans": statistics.scans,
        "shards": shards,
        "classes": {str(number): name for number, name in CLASS_NAMES.items()},
        "statistics": statistics.counted(),
        "flaws_redrawn": redrawn,
        "flaws_dropped": dropped,
        "failed": failed,
    }
    dataset["warnings"] = shortfalls(dataset)
    write_whole(out / "dataset.json", json.dumps(dataset, indent=1) + "\n")
    return dataset


def _shard_statistics(journal: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a rebuild with other versions is held against, within a tolerance."""
    rows, flaws = journal["scans"], journal["flaws"]
    depths = [row["depth_mean_mm"] for row in rows if row["depth_mean_mm"] is not None]
    return {
        "share_valid": sum(row["share_valid"] for row in rows) / len(rows) if rows else None,
        "depth_mean_mm": sum(depths) / len(depths) if depths else None,
        "flaw_pixels": sum(row["pixels"] for row in flaws),
    }


class _Table:
    """A table that grows row by row on disk as Parquet and CSV, whole or not there."""

    def __init__(self, stem: Path, columns: Mapping[str, type]) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        kinds = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
        self._schema = pa.schema([(name, kinds[kind]) for name, kind in columns.items()])
        self._columns = columns
        self._files = ExitStack()
        parquet, text = (
            self._files.enter_context(whole(stem.with_suffix(end), synced=True))
            for end in (".parquet", ".csv")
        )
        self._parquet = pq.ParquetWriter(parquet, self._schema)
        self._text = text.open("w", encoding="utf-8", newline="")
        self._csv = csv.DictWriter(self._text, list(columns), lineterminator="\n")
        self._csv.writeheader()
        self._rows: list[dict[str, Any]] = []

    def add(self, row: Mapping[str, Any]) -> None:
        """Append a row; keys without a column are ignored."""
        self._rows.append({name: row.get(name) for name in self._columns})
        if len(self._rows) == ROWS_AT_ONCE:
            self._flush()

    def _flush(self) -> None:
        import pyarrow as pa

        if self._rows:
            columns = [
                _column([row[field.name] for row in self._rows], field.type)
                for field in self._schema
            ]
            self._parquet.write_table(pa.Table.from_arrays(columns, schema=self._schema))
            self._csv.writerows(self._rows)
            self._rows.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._files:  # renames both; after a fault nothing stays of either
            with closing(self._parquet), closing(self._text):
                if error is None:
                    self._flush()
            if error is not None:
                raise error


def _column(values: list[Any], kind: Any) -> Any:
    """Return an Arrow array of text or numbers; `pyarrow.array` would load pandas to make it."""
    import pyarrow as pa

    there = np.array([value is not None for value in values], dtype=np.bool_)
    known = None if there.all() else pa.py_buffer(np.packbits(there, bitorder="little"))
    if kind == pa.string():
        texts = [b"" if value is None else value.encode() for value in values]
        ends = np.cumsum([0, *(len(text) for text in texts)], dtype=np.int32)
        buffers = [pa.py_buffer(ends), pa.py_buffer(b"".join(texts))]
    elif kind == pa.bool_():
        buffers = [pa.py_buffer(np.packbits([bool(v) for v in values], bitorder="little"))]
    else:
        numbers = np.array([0 if value is None else value for value in values])
        buffers = [pa.py_buffer(numbers.astype(kind.to_pandas_dtype()))]
    return pa.Array.from_buffers(kind, len(values), [known, *buffers])
