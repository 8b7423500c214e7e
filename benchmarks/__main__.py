"""All benchmarks: docs/benchmarks.md, its plot, and the tables of docs/scaling.md.

`--only` measures some sections again; the others stay as their own last run left them.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks import page, results
from benchmarks.casting import built_in_meshes, growth_rows, mesh_file, rows
from benchmarks.datasets import batch_cost, batches, dask_seconds, job_cost, plan_cost
from benchmarks.end_to_end import (
    HOME,
    SIZES,
    copied_bytes_per_s,
    scan_cost_alone,
    stored_bytes_per_s,
)
from benchmarks.perlin import fields, median_seconds
from benchmarks.waits import carvings, packings, uses
from pipeline.batch.backend import THREADS

MESHES = tuple(
    HOME.parent / "shared" / "meshes" / "cad" / name for name in ("ADIS16480.STL", "cycloidal.ply")
)
FULL = (2000, 4096)
POINTS = ((250, 4096), (500, 4096), (1000, 4096), FULL)
FACETS_UM = (80.0, 20.0, 6.0)


def main() -> None:
    """Measure, keep, and fill the pages with what was measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", type=Path, default=HOME / "docs", help="folder of the pages")
    parser.add_argument("--kept", type=Path, default=HOME / "out" / "bench")
    parser.add_argument(
        "--only", nargs="*", choices=results.SECTIONS, default=results.SECTIONS,
        help="sections to measure; none: fill the pages with what is kept",
    )  # fmt: skip
    parser.add_argument("--rounds", type=int, default=7, help="repeats of a scan, median counts")
    parser.add_argument("--turns", type=int, default=3, help="repeats of a dataset, 1 and 2 jobs")
    parser.add_argument("--mesh", type=Path, nargs="*", default=MESHES, help="real meshes")
    arguments = parser.parse_args()
    os.environ.update(THREADS)
    for name in arguments.only:
        load, begin = os.getloadavg()[0], time.perf_counter()
        facts = MEASURE[name](arguments)
        section = results.Section(
            machine=asdict(page.Machine.here()), load=load, seconds=time.perf_counter() - begin,
            facts=facts,
        )  # fmt: skip
        results.keep(arguments.kept, name, section)
        print(f"{section.seconds:6.0f} s  {name}", flush=True)
    found = results.read(arguments.kept)
    if "growth" in found:
        page.plot(arguments.docs / "pictures" / "growth.png", found["growth"])
    for name, shown in (
        ("benchmarks.md", page.blocks(found)), ("scaling.md", page.scaling(found))
    ):  # fmt: skip
        path = arguments.docs / name
        path.write_text(page.fill(path.read_text(encoding="utf-8"), shown), encoding="utf-8")
        print(f"filled {path}")


def _scans(arguments: argparse.Namespace) -> dict[str, Any]:
    return {
        "scans": [scan_cost_alone(*size, rounds=arguments.rounds) for size in SIZES],
        "copied_bytes_per_s": copied_bytes_per_s(),
        "stored_bytes_per_s": stored_bytes_per_s(),
        "plan": plan_cost(),
    }


def _jobs(_arguments: argparse.Namespace) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        recipes = batches(Path(folder))
        return {"jobs": [job_cost(name, recipes[name]) for name in list(recipes)[:3]]}


def _datasets(arguments: argparse.Namespace) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        recipes = batches(Path(folder))
        return {
            "datasets": [
                batch_cost(name, recipe, turns=arguments.turns)
                for name, recipe in recipes.items()
            ],
            "dask_s": dask_seconds(list(recipes.values())[1]),
        }


def _casting(arguments: argparse.Namespace) -> dict[str, Any]:
    casting = rows(built_in_meshes())
    casting += rows(mesh_file(path) for path in arguments.mesh if path.exists())
    return {
        "casting": casting,
        "absent": [path.name for path in arguments.mesh if not path.exists()],
    }


def _growth(arguments: argparse.Namespace) -> dict[str, Any]:
    return {
        "triangles": growth_rows(),
        "scanned": [
            scan_cost_alone(*FULL, rounds=arguments.rounds, facet_um=facet_um)
            for facet_um in FACETS_UM
        ],
        "points": [scan_cost_alone(*size, rounds=arguments.rounds) for size in POINTS],
    }


def _noise(_arguments: argparse.Namespace) -> dict[str, Any]:
    return {"noise": {name: median_seconds(field) for name, field in fields().items()}}


def _waits(arguments: argparse.Namespace) -> dict[str, Any]:
    rounds = max(2, arguments.rounds // 2)
    return {"carving": carvings(rounds), "packing": packings(rounds), "uses": uses(rounds)}


MEASURE: dict[str, Callable[[argparse.Namespace], dict[str, Any]]] = {
    "scans": _scans,
    "waits": _waits,
    "jobs": _jobs,
    "datasets": _datasets,
    "casting": _casting,
    "growth": _growth,
    "noise": _noise,
}


if __name__ == "__main__":
    main()
