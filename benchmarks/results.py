"""What the benchmarks measured, section by section, kept as JSON so that one can be made again."""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.casting import GrowthRow, Row
from benchmarks.end_to_end import BatchCost, ScanCost

SECTIONS = ("scans", "datasets", "casting", "growth", "noise")


@dataclass(frozen=True, kw_only=True, slots=True)
class Results:
    """All that the page shows.

    Attributes
    ----------
    machine
        Processor, cores and versions, see `benchmarks.page.Machine`.
    load, seconds
        By section: load of the machine before it, and how long it took.
    scans
        A labelled scan at each size.
    datasets, dask_s
        Datasets with 1 and 2 jobs, and seconds of one by two Dask workers, where installed.
    casting, absent
        Casters side by side, and meshes that weren't there.
    triangles, scanned, points
        Cast and labelled scan against triangles, labelled scan against points.
    noise
        Seconds by field.
    """

    machine: dict[str, Any]
    load: dict[str, float]
    seconds: dict[str, float]
    scans: list[ScanCost]
    datasets: list[BatchCost]
    dask_s: float | None
    casting: list[Row]
    absent: list[str]
    triangles: list[GrowthRow]
    scanned: list[ScanCost]
    points: list[ScanCost]
    noise: dict[str, float]


def keep(folder: Path, section: str, facts: Mapping[str, Any]) -> None:
    """Write a section's fields of `Results`; of machine, load and seconds its own share."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{section}.json").write_text(json.dumps(facts, default=dataclasses.asdict))


def missing(folder: Path) -> list[str]:
    """Name the sections that aren't kept."""
    return [name for name in SECTIONS if not (folder / f"{name}.json").exists()]


def read(folder: Path) -> Results:
    """Read all sections.

    Raises
    ------
    ValueError
        Where they are of several machines or versions.
    """
    facts: dict[str, Any] = {"load": {}, "seconds": {}}
    for section in SECTIONS:
        own = json.loads((folder / f"{section}.json").read_text())
        machine = own.pop("machine")
        if facts.setdefault("machine", machine) != machine:
            raise ValueError(f"{folder}: {section} is of another machine: measure all again")
        for name in ("load", "seconds"):
            facts[name][section] = own.pop(name)
        facts |= own
    for name, kind in (
        ("scans", ScanCost), ("scanned", ScanCost), ("points", ScanCost),
        ("casting", Row), ("triangles", GrowthRow),
    ):  # fmt: skip
        facts[name] = [kind(**one) for one in facts[name]]
    facts["datasets"] = [
        BatchCost(**one | {"seconds": {int(k): v for k, v in one["seconds"].items()}})
        for one in facts["datasets"]
    ]
    return Results(**facts)
