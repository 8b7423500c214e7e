"""A labelled scan from its path to the disk, stage by stage.

`python -m benchmarks.end_to_end` prints seconds per scan at two sizes.
Each size is measured in a process of its own, so that its peak of memory is its own.
"""

import argparse
import dataclasses
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.batch.backend import THREADS

HOME = Path(__file__).resolve().parents[1]
SIZES = ((200, 512), (2000, 4096))
SCANS = {
    "cast": "flawed and clean cast",
    "sight": "sight lines to the camera",
    "noise": "speckle, uncertainty, rounding",
    "labels": "labels, counts and the rest",
    "write": "encode, checksum, compress, write",
}
RECIPE = """\
name: bench
seed: 6
sensor: sensor.yaml
surface: car_door
profiles: {profiles}
points: {points}
{work}
parts:
{parts}
flaws:
  min_distance_mm: 10
  dent: {{number: 3, length_mm: {{uniform: [15, 30]}}, depth_mm: {{uniform: [0.4, 1.0]}}}}
  scratch: {{number: 2, length_mm: {{uniform: [20, 50]}}}}
  crack: 1
  bump: 1
motion:
  length_mm: 400
  aim_at_flaws: 0
"""
DOOR = "  - builtin: car_door\n    facet_um: {}"
FACET_UM = 10.0


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanCost:
    """What one labelled scan of the car door costs.

    Attributes
    ----------
    profiles, points, triangles
        Its size, and that of the flawed door.
    wall_s, processor_s
        Median seconds of the whole scan, by the clock and on the processor.
    stages_s
        Median seconds by the clock of each stage of `SCANS`.
    disk_bytes
        Median size of a shard with one scan.
    peak_bytes
        Most memory that the process held, loading and cutting the part included.
    specimen_s
        Processor seconds in which the flaws were drawn and cut, not part of the scan.
    """

    profiles: int
    points: int
    triangles: int
    wall_s: float
    processor_s: float
    stages_s: dict[str, float]
    disk_bytes: int
    peak_bytes: int
    specimen_s: float


def recipe_in(folder: Path, *, profiles: int, points: int, parts: str, work: str = "") -> Path:
    """Write a recipe for the AT-C5-4090CS30-495 with its camera's shadows; return its path."""
    from sensors.datasheet import Datasheet

    sheet = Datasheet.load("AT-C5-4090CS30-495")
    sheet = dataclasses.replace(
        sheet, triangulation_angle_deg=30.0, effects=({"name": "camera_occlusion"},)
    )
    sheet.save(folder / "sensor.yaml")
    path = folder / "bench.yaml"
    path.write_text(RECIPE.format(profiles=profiles, points=points, parts=parts, work=work))
    return path


def scan_cost(profiles: int, points: int, *, rounds: int = 7, part: str) -> ScanCost:
    """Scan one flawed part `rounds` times in this process and write each scan."""
    from pipeline.batch.backend import keep_memory, one_thread
    from pipeline.batch.plan import PlannedPart, PlannedScans
    from pipeline.batch.run import find_wanted
    from pipeline.batch.work import _scan
    from pipeline.dataset.shards import ShardWriter
    from pipeline.injection.specimen import load_entry, make_specimen, store_part
    from pipeline.recipe import Recipe

    one_thread()
    keep_memory()  # as a job does
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recipe = Recipe.load(recipe_in(folder, profiles=profiles, points=points, parts=part))
        recipe = recipe.ready()
        (wanted,), _ = find_wanted(recipe)
        solid = load_entry(wanted.entry, wanted.path, wanted.name)
        planned = PlannedPart(
            name=wanted.name, entry=wanted.entry, stored=store_part(solid, folder)
        )
        make_specimen(recipe, planned, 1, folder)  # compiled, the part's trees built
        begin = time.process_time()
        specimen = make_specimen(recipe, planned, 0, folder)
        specimen_s = time.process_time() - begin
        work = PlannedScans(
            part=planned, specimen=0, splits=("train",) * rounds, split_by="part",
            first=0, last=rounds, wanted={},
        )

        def one(number: int) -> Path:
            shard = folder / f"{number}.h5"
            with ShardWriter(
                shard,
                datasheet=recipe.datasheet,
                shape=(1, profiles, points),
                attributes={},
            ) as writer:
                scan, _, _ = _scan(recipe, work, specimen, number)
                writer.add("bench", scan)
            return shard

        one(0).unlink()  # compiled, and every tree built
        walls, processors, stages, sizes = [], [], [], []
        for number in range(rounds):
            with stopwatch() as laps:
                begin, busy = time.perf_counter(), time.process_time()
                shard = one(number)
                walls.append(time.perf_counter() - begin)
                processors.append(time.process_time() - busy)
            laps["labels"] = walls[-1] - sum(laps.values())
            stages.append(laps)
            sizes.append(shard.stat().st_size)
            shard.unlink()
        return ScanCost(
            profiles=profiles,
            points=points,
            triangles=len(specimen.flawed.faces),
            wall_s=statistics.median(walls),
            processor_s=statistics.median(processors),
            stages_s={key: statistics.median(lap[key] for lap in stages) for key in SCANS},
            disk_bytes=round(statistics.median(sizes)),
            peak_bytes=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
            specimen_s=specimen_s,
        )


@contextmanager
def stopwatch() -> Iterator[dict[str, float]]:
    """Add up seconds by the clock within the stages' functions; yields them by stage."""
    from pipeline.dataset.shards import ShardWriter
    from sensors.casting.scene import Scene
    from sensors.law import Law
    from sensors.view import view

    places: list[tuple[str, Any, str]] = [
        ("cast", Scene, "cast"),
        ("sight", view, "camera_visible"),
        ("sight", Scene, "blocked"),
        ("noise", Law, "sample"),
        ("write", ShardWriter, "add"),
        ("write", ShardWriter, "__exit__"),
    ]
    laps = dict.fromkeys(("cast", "sight", "noise", "write"), 0.0)

    def timed(stage: str, run: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*arguments: Any, **more: Any) -> Any:
            begin = time.perf_counter()
            try:
                return run(*arguments, **more)
            finally:
                laps[stage] += time.perf_counter() - begin

        return wrapped

    with ExitStack() as undo:
        for stage, owner, name in places:
            run = getattr(owner, name)
            setattr(owner, name, timed(stage, run))
            undo.callback(setattr, owner, name, run)
        yield laps


def scan_cost_alone(
    profiles: int, points: int, *, rounds: int = 7, facet_um: float = FACET_UM
) -> ScanCost:
    """`scan_cost` of the car door in a process of its own with one thread."""
    said = subprocess.run(
        [
            sys.executable, "-m", "benchmarks.end_to_end",
            "--one", str(profiles), str(points), "--rounds", str(rounds),
            "--facet-um", str(facet_um),
        ],
        cwd=HOME, env={**os.environ, **THREADS}, check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    return ScanCost(**json.loads(said.splitlines()[-1]))


def stored_bytes_per_s() -> float:
    """Return how fast this machine writes bytes that reach the disk: a limit for shards."""
    block = np.random.default_rng(0).bytes(1 << 26)
    rates = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(3):
            begin = time.perf_counter()
            with (Path(folder) / f"{number}").open("wb") as file:
                for _ in range(4):
                    file.write(block)
                file.flush()
                os.fsync(file.fileno())
            rates.append(4 * len(block) / (time.perf_counter() - begin))
    return statistics.median(rates)


def copied_bytes_per_s() -> float:
    """Return how fast one core copies float64 numbers in memory: a limit for 8.2 M readings."""
    source = np.ones(SIZES[1][0] * SIZES[1][1])
    target = np.zeros_like(source)
    rates = []
    for _ in range(7):
        begin = time.process_time()
        np.copyto(target, source)
        rates.append(source.nbytes / (time.process_time() - begin))
    return statistics.median(rates)


def main() -> None:
    """Print the tables, or with --one a single size's figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--one", type=int, nargs=2, metavar=("PROFILES", "POINTS"))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--facet-um", type=float, default=FACET_UM, help="of the car door")
    arguments = parser.parse_args()
    if arguments.one:
        door = DOOR.format(arguments.facet_um)
        cost = scan_cost(*arguments.one, rounds=arguments.rounds, part=door)
        print(json.dumps(dataclasses.asdict(cost)))
        return
    for size in SIZES:
        cost = scan_cost_alone(*size, rounds=arguments.rounds)
        print(f"{cost.profiles} × {cost.points}: {cost.wall_s:.3f} s", cost)


if __name__ == "__main__":
    main()
