"""All benchmarks in one run: docs/benchmarks.md, its plot, and the tables of docs/scaling.md."""

import argparse
import os
import tempfile
import time
from pathlib import Path

from benchmarks import page
from benchmarks.casting import built_in_meshes, growth_rows, mesh_file, rows
from benchmarks.end_to_end import (
    HOME,
    ONE_THREAD,
    SIZES,
    batch_cost,
    batches,
    dask_seconds,
    scan_cost_alone,
)
from benchmarks.perlin import fields, median_seconds

MESHES = tuple(
    HOME.parent / "shared" / "meshes" / "cad" / name for name in ("ADIS16480.STL", "cycloidal.ply")
)
POINTS = ((250, 4096), (500, 4096), (1000, 4096), (2000, 4096))


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HOME / "docs")
    parser.add_argument("--rounds", type=int, default=7, help="repeats of a scan, median counts")
    parser.add_argument("--turns", type=int, default=3, help="repeats of a dataset, 1 and 2 jobs")
    parser.add_argument("--mesh", type=Path, nargs="*", default=MESHES, help="real meshes")
    arguments = parser.parse_args()
    os.environ.update(ONE_THREAD)
    begin = time.perf_counter()

    def done(what: str) -> None:
        print(f"{time.perf_counter() - begin:6.0f} s  {what}", flush=True)

    machine = page.Machine.here()
    scans = [scan_cost_alone(*size, rounds=arguments.rounds) for size in SIZES]
    done("labelled scans")
    with tempfile.TemporaryDirectory() as folder:
        datasets = []
        recipes = batches(Path(folder))
        for name, recipe in recipes.items():
            datasets.append(batch_cost(name, recipe, turns=arguments.turns))
            done(name)
        dask = dask_seconds(list(recipes.values())[1])
        done("Dask")
    casting = rows(built_in_meshes())
    absent = [path.name for path in arguments.mesh if not path.exists()]
    casting += rows(mesh_file(path) for path in arguments.mesh if path.exists())
    done("casting")
    triangles = growth_rows()
    points = [scan_cost_alone(*size, rounds=arguments.rounds) for size in POINTS]
    done("growth")
    noise = {name: median_seconds(field) for name, field in fields().items()}
    text = page.write(
        machine=machine,
        scans=scans,
        datasets=datasets,
        dask=dask,
        casting=casting,
        absent=absent,
        triangles=triangles,
        points=points,
        noise=noise,
        seconds=time.perf_counter() - begin,
    )
    pictures = arguments.out / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    page.plot(pictures / "growth.png", triangles, points)
    (arguments.out / "benchmarks.md").write_text(text, encoding="utf-8")
    other = HOME / "docs" / "scaling.md"
    filled = page.fill(other.read_text(encoding="utf-8"), page.scaling(scans, datasets, dask))
    (arguments.out / "scaling.md").write_text(filled, encoding="utf-8")
    done(f"wrote {arguments.out / 'benchmarks.md'}")


if __name__ == "__main__":
    main()
