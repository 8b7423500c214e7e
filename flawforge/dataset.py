"""Read a generated dataset: lazily, one scan at a time, from any process.

Imports nothing else of this project but `flawforge.open_shard` and `flawforge.shard_folder` and
needs numpy, h5py and pandas only, and hdf5plugin for shards compressed by zstd or lz4::

    import flawforge.dataset

    scans = flawforge.dataset.open("out/quickstart")
    scan = scans[0]                      # dict of arrays: depth (mm, NaN = missing), mask, ...
    train = scans.split("train")         # again a dataset, good for torch's DataLoader
    cloud = scans.points(0)              # (k, 3) mm, part frame
"""

import importlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from numpy.typing import DTypeLike, NDArray

from flawforge.open_shard import OpenShard, ShardError, place, source
from flawforge.shard_folder import ShardFolder

__all__ = ["Dataset", "ShardError", "open"]

Scan = dict[str, Any]


def open(
    folder: str | Path,
    *,
    fields: Sequence[str] | None = None,
    raw: bool = False,
    dtype: DTypeLike = np.float64,
) -> "Dataset":
    """Open the dataset that `flawforge generate` wrote into `folder`.

    Parameters
    ----------
    folder : path or str
        Holds manifest.parquet or manifest.csv, and the shards; or their prefix of an object
        store, "s3://bucket/prefix".
    fields : sequence of str, optional
        Arrays of a scan, for instance ``("depth", "mask")``; all by default. Other arrays are
        not read.
    raw : bool
        Return stored counts instead of depths; see `Dataset.coding`.
    dtype : dtype
        Type of the depths in mm. float64 holds them exactly; float32 to 0.02 µm at 400 mm.

    Raises
    ------
    ShardError
        Where the folder holds no dataset, or the tables are unreadable.
    """
    folder = place(folder)
    manifest = _table(folder, "manifest")
    if manifest is None:
        raise ShardError(folder, "no dataset here (neither manifest.parquet nor manifest.csv)")
    lacking = {"scan_id", "shard", "row"} - set(manifest.columns)
    if lacking:
        raise ShardError(folder, f"the manifest has no column {', '.join(sorted(lacking))}")
    flaws = _table(folder, "flaws")
    return Dataset(
        folder,
        manifest,
        pd.DataFrame({"scan_id": pd.Series(dtype=str)}) if flaws is None else flaws,
        _json(folder / "dataset.json"),
        fields=tuple(fields) if fields is not None else None,
        raw=raw,
        dtype=np.dtype(dtype),
    )


class Dataset:
    """Scans of a dataset, by number or `scan_id`; made by `open`.

    Holds the tables and no scan: each access reads one scan from its shard. Each process opens its
    own files, so worker processes, forked or spawned, can share a dataset.

    Attributes
    ----------
    folder : Path
    manifest : DataFrame
        A row for each scan, in the order of the scans.
    flaws : DataFrame
        A row for each flaw and scan.
    info : dict
        dataset.json: recipe, versions, seed, shards, statistics; empty where it is missing.
    fields : tuple of str or None
        The arrays read; None: all.
    """

    def __init__(
        self,
        folder: Path,
        manifest: pd.DataFrame,
        flaws: pd.DataFrame,
        info: dict[str, Any],
        *,
        fields: tuple[str, ...] | None = None,
        raw: bool = False,
        dtype: np.dtype[Any],
    ) -> None:
        self.folder = folder
        self.manifest = manifest.reset_index(drop=True)
        self.flaws = flaws
        self.info = info
        self.fields = fields
        self.raw = raw
        self.dtype = dtype
        self._where = {str(name): at for at, name in enumerate(self.manifest["scan_id"])}
        self._shards = ShardFolder(folder)
        self._places = tuple(self.manifest[key].to_numpy() for key in ("shard", "row", "scan_id"))

    def __repr__(self) -> str:
        return f"Dataset({str(self.folder)!r}, {len(self)} scans)"

    def __len__(self) -> int:
        return len(self.manifest)

    def __iter__(self) -> Iterator[Scan]:
        return (self[at] for at in range(len(self)))

    @overload
    def __getitem__(self, which: int | np.integer[Any] | str) -> Scan: ...
    @overload
    def __getitem__(self, which: slice) -> "Dataset": ...
    def __getitem__(self, which: int | np.integer[Any] | str | slice) -> "Scan | Dataset":
        """Return one scan as a dict of arrays, or for a slice the dataset of those scans.

        Depths are in mm, NaN = missing, shape (profiles, points); `mask`, `mask_visible` and
        `invalid_reason` uint8, `instance` int32; `pose` and `pose_true` (profiles, 4, 4) sensor to
        part; `time` (profiles,) s; `ray_x_mm` and `ray_slope` (points,), so that a reading's point
        in the sensor frame is (ray_x_mm + depth * ray_slope, 0, depth); `scan_id` str.

        Raises
        ------
        IndexError, KeyError
            Where there is no such scan.
        ShardError
            Where its shard is missing or damaged.
        """
        if isinstance(which, slice):
            return self._some(self.manifest.iloc[which])
        return self._read(self._position(which), self.fields)

    def index(self, scan_id: str) -> int:
        """Return the number of the scan with this id.

        Raises
        ------
        KeyError
            For an unknown id.
        """
        return self._where[scan_id]

    @property
    def classes(self) -> dict[int, str]:
        """Names of the mask's values."""
        named = self.info.get("classes")
        if named is None and len(self):
            named = self._shards[str(self.manifest["shard"].iloc[0])].classes
        return {int(key): str(name) for key, name in (named or {}).items()}

    @property
    def splits(self) -> dict[str, int]:
        """Number of scans in each split."""
        if "split" not in self.manifest:
            return {}
        counts = self.manifest["split"].value_counts(sort=False)
        return {str(name): int(count) for name, count in counts.items()}

    def split(self, name: str) -> "Dataset":
        """Return the dataset of the scans in split `name` ("train", "val", "test", ...).

        Raises
        ------
        KeyError
            Where there is no such split.
        """
        if name not in self.splits:
            raise KeyError(f"no split {name!r}; there are {', '.join(self.splits) or 'none'}")
        return self._some(self.manifest[self.manifest["split"] == name])

    def filter(
        self,
        *,
        split: str | None = None,
        part: str | None = None,
        kind: str | None = None,
        seen: bool | None = None,
        visible: bool | None = None,
    ) -> "Dataset":
        """Return the dataset of the scans that meet all conditions given.

        Parameters
        ----------
        split, part : str
            Columns of the manifest.
        kind : str
            A flaw of this kind is labelled in the scan.
        seen, visible : bool
            Whether a flaw (of `kind`, where given) has labelled points, or visible ones.
        """
        keep = pd.Series(True, index=self.manifest.index)
        for column, value in (("split", split), ("part", part)):
            if value is not None:
                keep &= self.manifest[column].eq(value)
        flaws = self.flaws if kind is None else self.flaws[self.flaws["kind"].eq(kind)]
        if kind is not None and seen is None and visible is None:
            seen = True
        for column, wanted in (("pixels", seen), ("pixels_visible", visible)):
            if wanted is not None:
                ids = {*flaws.loc[flaws[column] > 0, "scan_id"]} if len(flaws) else set()
                keep &= self.manifest["scan_id"].isin(ids) == wanted
        return self._some(self.manifest[keep])

    def show(self, which: int | str) -> Any:
        """Draw a scan: reading, labels, a cut, the cloud. Needs flawforge itself installed.

        Returns
        -------
        PIL.Image.Image
            Which a notebook displays.
        """
        import io

        # by name: this module works without the rest of the project
        pictures = importlib.import_module("pipeline.preview.scan_picture")
        image = importlib.import_module("PIL.Image")
        buffer = io.BytesIO()
        scan_id = str(self.manifest["scan_id"].iloc[self._position(which)])
        pictures.scan_figure(self.folder, scan_id).savefig(buffer, dpi=pictures.DPI)
        return image.open(buffer)

    def _repr_html_(self) -> str:
        """Return the dataset's summary for a notebook."""
        import html

        kinds: dict[Any, Any] = {}
        if {"kind", "pixels"} <= {*self.flaws.columns}:
            kinds = dict(self.flaws.loc[self.flaws["pixels"] > 0, "kind"].value_counts())
        facts = {
            "scans": len(self),
            "splits": ", ".join(f"{name} {count}" for name, count in self.splits.items()),
            "parts": ", ".join(map(str, self.manifest["part"].unique()))
            if "part" in self.manifest
            else "",
            "flaws seen": ", ".join(f"{kind} {count}" for kind, count in kinds.items()),
        }
        rows = "".join(
            f"<tr><th>{html.escape(key)}</th><td>{html.escape(str(value))}</td></tr>"
            for key, value in facts.items()
        )
        title = html.escape(str(self.info.get("name", self.folder.name)))
        return f"<table><caption>{title}</caption>{rows}</table>"

    def flaws_of(self, which: int | str) -> pd.DataFrame:
        """Return the rows of `flaws` that belong to one scan."""
        scan_id = self.manifest["scan_id"].iloc[self._position(which)]
        return self.flaws.loc[self.flaws["scan_id"].eq(scan_id)]

    def points(
        self,
        which: int | str,
        *,
        frame: Literal["part", "sensor"] = "part",
        depth: str = "depth",
        pose: str = "pose",
    ) -> NDArray[np.float64]:
        """Return a scan's valid points as a cloud.

        Parameters
        ----------
        which : int or str
            The scan.
        frame : {"part", "sensor"}
            In the sensor frame all profiles lie in the plane y = 0.
        depth : {"depth", "depth_ideal", "depth_clean"}
            Array of depths.
        pose : {"pose", "pose_true"}
            Commanded or true poses.

        Returns
        -------
        (k, 3) float64
            mm, row by row: the points where the depth isn't NaN, so that
            ``mask[np.isfinite(depth)]`` are their labels.
        """
        if frame not in ("part", "sensor"):
            raise ValueError(f"frame must be 'part' or 'sensor', not {frame!r}")
        at = self._position(which)
        scan = self._read(at, (depth, pose, "ray_x_mm", "ray_slope"), decode=True)
        depth_mm = np.asarray(scan[depth], dtype=np.float64)
        valid = np.isfinite(depth_mm)
        x_mm = (scan["ray_x_mm"] + depth_mm * scan["ray_slope"])[valid]
        cloud = np.stack([x_mm, np.zeros_like(x_mm), depth_mm[valid]], axis=1)
        if frame == "sensor":
            return cloud
        poses = scan[pose][np.nonzero(valid)[0]]
        return np.asarray(np.einsum("kij,kj->ki", poses[:, :3, :3], cloud) + poses[:, :3, 3])

    def coding(self, field: str) -> dict[str, float]:
        """Return `scale_mm`, `offset_mm` and `missing` of stored counts; empty for plain numbers.

        A depth is offset_mm + scale_mm * count; the count `missing` stands for a missing reading.
        """
        return dict(self._shards[str(self.manifest["shard"].iloc[0])].coding(field))

    def close(self) -> None:
        """Close the files that this process holds; they reopen when needed."""
        self._shards.close()

    def _some(self, manifest: pd.DataFrame) -> "Dataset":
        flaws = self.flaws[self.flaws["scan_id"].isin(manifest["scan_id"])]
        return Dataset(
            self.folder,
            manifest,
            flaws.reset_index(drop=True),
            self.info,
            fields=self.fields,
            raw=self.raw,
            dtype=self.dtype,
        )

    def _position(self, which: int | np.integer[Any] | str) -> int:
        if isinstance(which, str):
            return self.index(which)
        at = int(which)
        if not -len(self) <= at < len(self):
            raise IndexError(f"no scan {at}: there are {len(self)}")
        return at % len(self)

    def _read(self, at: int, fields: Sequence[str] | None, *, decode: bool = False) -> Scan:
        name, where, expected = (column[at] for column in self._places)
        row, shard = int(where), self._shards[str(name)]
        if not 0 <= row < len(shard.names):
            what = f"has {len(shard.names)} scans, the manifest wants row {row}"
            raise ShardError(shard.path, what)
        if shard.names[row] != expected:
            what = f"row {row} is scan {shard.names[row]!r}, the manifest has {expected!r}"
            raise ShardError(shard.path, what)
        scan: Scan = {}
        for field in fields if fields is not None else shard.fields:
            if field == "scan_id":
                scan[field] = expected
                continue
            values = shard.scan(field, row)
            scan[field] = values if self.raw and not decode else self._decode(shard, field, values)
        return scan

    def _decode(self, shard: OpenShard, field: str, values: NDArray[Any]) -> NDArray[Any]:
        if shard.coding(field):
            return shard.depth_mm(field, values).astype(self.dtype, copy=False)
        if values.dtype.kind == "u" and values.dtype.itemsize > 1:
            # torch's collate knows no unsigned integers wider than a byte
            return values.astype(np.int32 if values.dtype.itemsize == 2 else np.int64)
        if field.startswith("depth"):
            return values.astype(self.dtype, copy=False)
        return values


def _table(folder: Path, name: str) -> pd.DataFrame | None:
    """Read NAME.parquet, or NAME.csv where there is no parquet or nothing to read it with."""
    parquet, csv = folder / f"{name}.parquet", folder / f"{name}.csv"
    path = parquet if parquet.is_file() else csv
    try:
        if parquet.is_file():
            try:
                return pd.read_parquet(source(parquet))
            except ImportError:
                if not csv.is_file():
                    raise
        if csv.is_file():
            as_text = {"scan_id": str, "shard": str, "split": str, "part": str}
            return pd.read_csv(source(csv), dtype=as_text, keep_default_na=True)
    except (OSError, ValueError) as error:
        raise ShardError(path, f"can't be read ({error})") from None
    return None


def _json(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ShardError(path, f"can't be read ({error})") from None
    if not isinstance(data, dict):
        raise ShardError(path, "isn't a mapping")
    return data
