"""What the benchmarks measured, section by section, kept as JSON so that each has its own run."""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.casting import GrowthRow, Row
from benchmarks.datasets import BatchCost, JobCost, PlanCost
from benchmarks.end_to_end import ScanCost
from benchmarks.waits import Carving, Packing, Use

SECTIONS: Final = ("scans", "waits", "jobs", "datasets", "casting", "growth", "noise")
KINDS: Final[Mapping[str, Any]] = {
    "scans": ScanCost, "scanned": ScanCost, "points": ScanCost, "casting": Row,
    "triangles": GrowthRow, "carving": Carving, "packing": Packing, "uses": Use,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class Section:
    """One section's run.

    Attributes
    ----------
    machine
        Processor, cores and versions, see `benchmarks.page.Machine`.
    load, seconds
        Load of the machine before the run, and how long it took.
    facts
        What was measured, by name: lists of the types of `KINDS`; "datasets", a list of
        `BatchCost`, with "dask_s" (None: not installed); "jobs", a list of `JobCost`; "absent",
        meshes that weren't there; "noise", seconds by field; "copied_bytes_per_s" and
        "stored_bytes_per_s", what memory and disk give; "plan", a `PlanCost`.
    """

    machine: dict[str, Any]
    load: float
    seconds: float
    facts: dict[str, Any]


def keep(folder: Path, name: str, section: Section) -> None:
    """Write a section."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(section, default=dataclasses.asdict))


def read(folder: Path) -> dict[str, Section]:
    """Read the sections that are kept."""
    found = {}
    for name in SECTIONS:
        path = folder / f"{name}.json"
        if not path.exists():
            continue
        section = Section(**json.loads(path.read_text()))
        facts = section.facts
        for key, kind in KINDS.items():
            if key in facts:
                facts[key] = [kind(**one) for one in facts[key]]
        if "plan" in facts:
            facts["plan"] = PlanCost(**facts["plan"])
        if "datasets" in facts:
            facts["datasets"] = [
                BatchCost(**one | {"seconds": {int(k): v for k, v in one["seconds"].items()}})
                for one in facts["datasets"]
            ]
        if "jobs" in facts:
            facts["jobs"] = [
                JobCost(**one | {"processor_s": {int(k): v for k, v in one["processor_s"].items()}})
                for one in facts["jobs"]
            ]
        found[name] = section
    return found
