"""All benchmarks: docs/benchmarks.md, its plot, and the tables of docs/scaling.md.

`--only` measures some sections again and takes the others as they were kept in `--kept`.
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
from benchmarks.end_to_end import (
    HOME,
    SIZES,
    batch_cost,
    batches,
    dask_seconds,
    scan_cost_alone,
)
from benchmarks.perlin import fields, median_seconds
from pipeline.batch.backend import THREADS

MESHES = tuple(
    HOME.parent / "shared" / "meshes" / "cad" / name for name in ("ADIS16480.STL", "cycloidal.ply")
)
FULL = (2000, 4096)
POINTS = ((250, 4096), (500, 4096), (1000, 4096), FULL)
FACETS_UM = (80.0, 20.0, 6.0)


def main() -> None:
    """Measure, keep, and write the page once every section is there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HOME / "docs")
    parser.add_argument("--kept", type=Path, default=HOME / "out" / "bench")
    parser.add_argument(
        "--only", nargs="+", choices=results.SECTIONS, default=results.SECTIONS,
        help="sections to measure",
    )  # fmt: skip
    parser.add_argument("--rounds", type=int, default=7, help="repeats of a scan, median counts")
    parser.add_argument("--turns", type=int, default=3, help="repeats of a dataset, 1 and 2 jobs")
    parser.add_argument("--mesh", type=Path, nargs="*", default=MESHES, help="real meshes")
    arguments = parser.parse_args()
    os.environ.update(THREADS)
    for section in arguments.only:
        load, begin = os.getloadavg()[0], time.perf_counter()
        facts = MEASURE[section](arguments)
        facts |= {"load": load, "seconds": time.perf_counter() - begin}
        results.keep(arguments.kept, section, facts | {"machine": asdict(page.Machine.here())})
        print(f"{facts['seconds']:6.0f} s  {section}", flush=True)
    if lacking := results.missing(arguments.kept):
        print("no page yet: --only", *lacking)
        return
    found = results.read(arguments.kept)
    pictures = arguments.out / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    page.plot(pictures / "growth.png", found)
    (arguments.out / "benchmarks.md").write_text(page.write(found), encoding="utf-8")
    other = HOME / "docs" / "scaling.md"
    filled = page.fill(other.read_text(encoding="utf-8"), page.scaling(found))
    (arguments.out / "scaling.md").write_text(filled, encoding="utf-8")
    print(f"wrote {arguments.out / 'benchmarks.md'}")


def _scans(arguments: argparse.Namespace) -> dict[str, Any]:
    return {"scans": [scan_cost_alone(*size, rounds=arguments.rounds) for size in SIZES]}


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


MEASURE: dict[str, Callable[[argparse.Namespace], dict[str, Any]]] = {
    "scans": _scans,
    "datasets": _datasets,
    "casting": _casting,
    "growth": _growth,
    "noise": _noise,
}


if __name__ == "__main__":
    main()
