"""What every exporter is given: the chosen scans of a dataset, their labels as wanted."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from files.record import parse
from pipeline.dataset.shards import read_scan
from pipeline.dataset.tables import read_table
from pipeline.dataset.verify import read_dataset
from sensors.datasheet import Datasheet

if TYPE_CHECKING:
    import pandas as pd

LOG = logging.getLogger("flawforge.export")
MaskChoice = Literal["all", "visible"]
ImageChoice = Literal["relief8", "depth16", "float32"]
FLAW_KEYS: Final = ("depth_mm", "deviation_over_noise", "snr", "detectable")  # where columns exist


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Labelled:
    """One scan with the labels that were asked for; arrays are (profiles, points) unless said.

    Attributes
    ----------
    scan_id, split, part, specimen : str
    depth_mm : float64
        The reading, NaN = missing.
    mask : uint8
        Class, 0 = none.
    instance : int32
        Number of the flaw on its specimen, 0 = none; not 0 exactly where `mask` isn't.
    flaws : tuple of mappings
        Rows of flaws.parquet of the flaws that `instance` holds, in its order.
    arrays : mapping
        All arrays of the shard as read.
    """

    scan_id: str
    split: str
    part: str
    specimen: str
    depth_mm: NDArray[np.float64]
    mask: NDArray[np.uint8]
    instance: NDArray[np.int32]
    flaws: tuple[Mapping[str, Any], ...]
    arrays: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Source:
    """Scans of a dataset for an exporter; made by `read`.

    Attributes
    ----------
    folder : Path
    info : mapping
        dataset.json.
    manifest : DataFrame
        Rows of the chosen scans, in their order.
    mask : {"all", "visible"}
        Labels of all points of a flaw, or of those where it exceeds the noise.
    min_pixels : int
        Flaws with fewer labelled points are not labelled.
    image : {"relief8", "depth16", "float32"}
        What pictures hold, where the form has pictures.
    """

    folder: Path
    info: Mapping[str, Any]
    manifest: "pd.DataFrame"
    mask: MaskChoice
    min_pixels: int
    image: ImageChoice
    _flaws: Mapping[str, Sequence[Mapping[str, Any]]] = field(repr=False)

    @classmethod
    def read(
        cls,
        folder: Path,
        *,
        scans: Sequence[str] | None = None,
        splits: Sequence[str] | None = None,
        mask: MaskChoice = "all",
        min_pixels: int = 1,
        image: ImageChoice = "relief8",
    ) -> "Source":
        """Read a dataset's tables and choose its scans.

        Raises
        ------
        RecipeError
            Where there is no dataset, no such scan or no such split.
        """
        info = read_dataset(folder)
        manifest = read_table(folder / "manifest.parquet")
        flaws = read_table(folder / "flaws.parquet")
        manifest = _chosen(manifest, "scan_id", scans, "scan", folder)
        manifest = _chosen(manifest, "split", splits, "split", folder)
        if manifest.empty:
            raise RecipeError("no scan to export", where=folder)
        flaws = flaws[flaws["scan_id"].isin(manifest["scan_id"])]
        rows: dict[str, list[Mapping[str, Any]]] = {}
        for row in flaws.to_dict("records"):
            rows.setdefault(str(row["scan_id"]), []).append({str(k): v for k, v in row.items()})
        return cls(
            folder=folder, info=info, manifest=manifest.reset_index(drop=True), mask=mask,
            min_pixels=min_pixels, image=image, _flaws=rows,
        )  # fmt: skip

    @property
    def name(self) -> str:
        """The dataset's name."""
        return str(self.info["name"])

    @property
    def classes(self) -> dict[int, str]:
        """Names of the classes by their number, background left out; the same in every dataset."""
        return {int(k): str(v) for k, v in self.info["classes"].items() if int(k) > 0}

    @property
    def splits(self) -> dict[str, int]:
        """Splits in the order of the recipe with their numbers of chosen scans, none empty."""
        counts = self.manifest["split"].value_counts()
        order = [*self.info["recipe"].get("splits", ()), *sorted(counts.index)]
        return {str(name): int(counts[name]) for name in dict.fromkeys(order) if name in counts}

    @property
    def datasheet(self) -> Datasheet:
        """The sensor that the scans were generated with."""
        return parse(
            Datasheet, self.info["recipe"]["sensor"], where=str(self.folder / "dataset.json")
        )

    def scans(self, split: str | None = None) -> Iterator[Labelled]:
        """Read the scans of a split, or all, one after the other.

        Each that an exporter is done with is an event "scan" of the logger "flawforge.export".
        """
        for row in self.manifest.to_dict("records"):
            if split is None or row["split"] == split:
                yield self.scan(row)
                LOG.info("%s", row["scan_id"], extra={"event": "scan", "facts": {"scans": 1}})

    def scan(self, row: Mapping[Any, Any]) -> Labelled:
        """Read one scan by its row of the manifest."""
        path = self.folder / str(row["shard"])
        try:
            arrays = read_scan(path, int(row["row"]))
        except (OSError, KeyError, ValueError, IndexError) as error:
            said = " ".join(str(error).split())
            raise RecipeError(f"shard is missing or damaged ({said})", where=path) from None
        scan_id = str(row["scan_id"])
        mask = np.array(arrays["mask" if self.mask == "all" else "mask_visible"], dtype=np.uint8)
        instance = np.where(mask > 0, arrays["instance"], 0).astype(np.int32)
        counts = np.bincount(instance.ravel())
        few = np.flatnonzero((counts > 0) & (counts < self.min_pixels))
        few = few[few > 0]
        if few.size:
            small = np.isin(instance, few)
            instance[small], mask[small] = 0, 0
            counts[few] = 0
        seen = {int(number) for number in np.flatnonzero(counts)} - {0}
        own = sorted(self._flaws.get(scan_id, ()), key=lambda flaw: int(flaw["instance"]))
        return Labelled(
            scan_id=scan_id,
            split=str(row["split"]),
            part=str(row["part"]),
            specimen=str(row["specimen"]),
            depth_mm=np.asarray(arrays["depth"], dtype=np.float64),
            mask=mask,
            instance=instance,
            flaws=tuple(flaw for flaw in own if int(flaw["instance"]) in seen),
            arrays=arrays,
        )


def flaw_facts(flaw: Mapping[str, Any]) -> dict[str, Any]:
    """Return what annotations hold of a flaw beside its shape; None = unknown."""
    found: dict[str, Any] = {}
    for key in FLAW_KEYS:
        if key in flaw:
            value = flaw[key]
            known = isinstance(value, bool | np.bool_) or bool(np.isfinite(value))
            found[key] = (bool(value) if isinstance(value, np.bool_) else value) if known else None
    return found


def _chosen(
    table: "pd.DataFrame", column: str, wanted: Sequence[str] | None, noun: str, folder: Path
) -> "pd.DataFrame":
    if wanted is None:
        return table
    known = [str(name) for name in table[column].unique()]
    for name in wanted:
        if name not in known:
            some = ", ".join(known[:5] + ["..."] * (len(known) > 5))
            raise RecipeError(f"no such {noun}", where=folder, value=name, allowed=some)
    if noun == "scan":
        return table.set_index(column).loc[list(dict.fromkeys(wanted))].reset_index()
    return table[table[column].isin(list(wanted))]
