"""A labelled scan from its path to the disk, stage by stage; and whole datasets with 1 and 2 jobs.

`python -m benchmarks.end_to_end` prints seconds per scan at two sizes and datasets per minute.
Each size is measured in a process of its own, so that its peak of memory is its own.
"""

import argparse
import dataclasses
import importlib.util
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
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
    from pipeline.batch.plan import PlannedPart, PlannedScans
    from pipeline.batch.run import find_wanted
    from pipeline.batch.work import _scan
    from pipeline.dataset.shards import ShardWriter
    from pipeline.injection.specimen import load_entry, make_specimen, store_part
    from pipeline.recipe import Recipe

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


@dataclass(frozen=True, kw_only=True, slots=True)
class PlanCost:
    """What the plan and the tables of a large dataset cost: they are one process's.

    Attributes
    ----------
    scans
        How many were planned.
    seconds, peak_bytes
        Processor time, and the most memory that planning added.
    row_bytes
        Of a scan and its flaws in the manifest's files.
    """

    scans: int
    seconds: float
    peak_bytes: int
    row_bytes: float


def plan_cost(scans: int = 200_000) -> PlanCost:
    """Plan a dataset of so many scans, eight of each specimen; and weigh a small one's tables."""
    from pipeline.batch.plan import PlannedPart, make_plan
    from pipeline.batch.run import generate
    from pipeline.recipe import Recipe

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = recipe_in(
            folder, profiles=20, points=64, parts="  - builtin: steel_plate",
            work=f"specimens: {scans // 8}\nscans: 8",
        )  # fmt: skip
        recipe = Recipe.load(path)
        part = PlannedPart(name="steel_plate", entry=recipe.file.parts[0], stored="")
        tracemalloc.start()
        make_plan(recipe, [part])
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        begin = time.process_time()
        make_plan(recipe, [part])
        seconds = time.process_time() - begin
        small = Recipe.load(path, sets=["specimens=4"])
        made = generate(small, folder / "out")
        tables = [*(folder / "out").glob("*.csv"), *(folder / "out").glob("*.parquet")]
        size = sum(file.stat().st_size for file in tables)
    return PlanCost(
        scans=scans, seconds=seconds, peak_bytes=peak, row_bytes=size / made["scans"]
    )


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


@dataclass(frozen=True, kw_only=True, slots=True)
class BatchCost:
    """A dataset made with 1 and with 2 jobs in turns, by the clock; start-up included.

    Attributes
    ----------
    name
        What was made.
    scans
        How many scans it has.
    seconds
        For each number of jobs, a figure for each turn.
    apart_s
        For each turn, seconds in which two runs of 1 job each, started together, were both done.
    disk_bytes
        Size of the dataset's folder.
    """

    name: str
    scans: int
    seconds: dict[int, list[float]]
    apart_s: list[float]
    disk_bytes: int

    @property
    def ratios(self) -> list[float]:
        """How much faster 2 jobs are, for each turn."""
        return [one / two for one, two in zip(self.seconds[1], self.seconds[2], strict=True)]

    @property
    def limits(self) -> list[float]:
        """How much more the machine does with two runs that know nothing of each other."""
        return [2 * one / both for one, both in zip(self.seconds[1], self.apart_s, strict=True)]


MANY_JOBS = 8


@dataclass(frozen=True, kw_only=True, slots=True)
class JobCost:
    """What jobs add to a dataset, in processor time, which other work hardly changes.

    Attributes
    ----------
    name
        What was made.
    processor_s
        Of all processes together, for 1 job and for `MANY_JOBS`.
    serial_s
        Of the first process until scans can be made, its modules excepted.
    """

    name: str
    processor_s: dict[int, float]
    serial_s: float

    @property
    def each_job_s(self) -> float:
        """Processor seconds that each further job adds: libraries, parts, trees once more."""
        return max(0.0, (self.processor_s[MANY_JOBS] - self.processor_s[1]) / (MANY_JOBS - 1))

    def speed_up(self, jobs: int) -> float:
        """How much faster so many jobs on idle cores of their own would be, by processor time.

        Amdahl's law with what each job repeats: what is serial, a job's own, a share of the rest.
        """
        alone = self.serial_s + self.each_job_s
        return self.processor_s[1] / (alone + (self.processor_s[1] - alone) / jobs)


def batch_cost(name: str, recipe: Path, *, turns: int = 3) -> BatchCost:
    """Generate a recipe's dataset through the command line, 1 job and 2 jobs in turns."""
    seconds: dict[int, list[float]] = {1: [], 2: []}
    apart_s = []
    with tempfile.TemporaryDirectory() as name_of_folder:
        folder = Path(name_of_folder)
        for _ in range(turns):
            for jobs in seconds:
                seconds[jobs].append(_generated(recipe, folder / "out", jobs=jobs))
                made: Mapping[str, Any] = json.loads((folder / "out" / "dataset.json").read_text())
                files = [file for file in (folder / "out").rglob("*") if file.is_file()]
                size = sum(file.stat().st_size for file in files)
                shutil.rmtree(folder / "out")
            apart_s.append(_generated(recipe, folder / "a", folder / "b", jobs=1))
            shutil.rmtree(folder / "a")
            shutil.rmtree(folder / "b")
    return BatchCost(
        name=name, scans=made["scans"], seconds=seconds, apart_s=apart_s, disk_bytes=size
    )


def job_cost(name: str, recipe: Path) -> JobCost:
    """Generate a recipe's dataset by 1 job and by `MANY_JOBS`, and only until its first scan."""
    with tempfile.TemporaryDirectory() as name_of_folder:
        folder = Path(name_of_folder)
        processor_s = {
            jobs: _processor_s(partial(_generated, recipe, folder / f"{jobs}", jobs=jobs))
            for jobs in (1, MANY_JOBS)
        }
        serial_s = _serial_s(recipe, folder / "serial")
    return JobCost(name=name, processor_s=processor_s, serial_s=serial_s)


def _processor_s(run: Callable[[], Any]) -> float:
    """Return processor seconds of the processes that a call starts and waits for."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


SERIAL = """
import sys, time
from pathlib import Path
import pipeline.batch.work
from pipeline.batch import run, work
from pipeline.recipe import Recipe
begin = time.process_time()
def stop(*_):
    print(time.process_time() - begin)
    raise SystemExit
make = work.simulate
work.simulate = stop
run.generate(Recipe.load(sys.argv[1]), Path(sys.argv[2]))
"""


def _serial_s(recipe: Path, out: Path) -> float:
    """Return processor seconds from the recipe to the first scan: parts, plan, first specimen."""
    said = subprocess.run(
        [sys.executable, "-c", SERIAL, recipe, out], cwd=HOME, env={**os.environ, **THREADS},
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return float(said.stdout.splitlines()[-1])


def _generated(recipe: Path, *folders: Path, jobs: int) -> float:
    """Generate a dataset into each folder, all at once; return seconds until all are done."""
    begin = time.perf_counter()
    runs = [
        subprocess.Popen(
            [
                sys.executable, "-m", "flawforge.cli", "generate", recipe,
                "--out", folder, "--jobs", str(jobs),
            ],
            cwd=HOME, env={**os.environ, **THREADS},
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for folder in folders
    ]  # fmt: skip
    if any([run.wait() for run in runs]):
        raise RuntimeError(f"{recipe}: generate failed")
    return time.perf_counter() - begin


def dask_seconds(recipe: Path) -> float | None:
    """Generate a dataset by two Dask workers on this machine; None where Dask isn't installed.

    Scheduler and workers run already; connecting, loading and specimens are included.
    """
    if importlib.util.find_spec("distributed") is None:
        return None
    environment = {**os.environ, **THREADS, "PYTHONPATH": str(HOME)}
    with tempfile.TemporaryDirectory() as name, ExitStack() as ends:
        folder = Path(name)

        def spawn(kind: str, *words: str) -> None:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words, "--no-dashboard"],
                cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            ends.callback(process.wait)
            ends.callback(process.terminate)

        said = folder / "scheduler.json"
        port = ("--dashboard-address", "127.0.0.1:0")
        spawn(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(said), *port
        )
        while not said.exists():
            time.sleep(0.1)
        address = json.loads(said.read_text())["address"]
        for _ in range(2):
            spawn("worker", address, "--nthreads", "1", "--no-nanny", *port)
        time.sleep(5.0)
        begin = time.perf_counter()
        subprocess.run(
            [
                sys.executable, "-m", "flawforge.cli", "generate", recipe, "--out", folder / "out",
                "--backend", "dask", "--scheduler", address,
            ],
            cwd=HOME, env=environment, check=True, capture_output=True,
        )  # fmt: skip
        return time.perf_counter() - begin


def batches(folder: Path) -> dict[str, Path]:
    """Write the recipes of the datasets that are timed; by name."""
    quick = (HOME / "pipeline" / "recipes" / "quickstart.yaml").read_text()
    found = {"quickstart, 12 specimens, 48 scans of 240 × 512": quick}
    larger = quick
    for old, new in (
        ("specimens: 4 ", "specimens: 8 "),
        ("scans: 4 ", "scans: 8 "),
        ("profiles: 240\n", "profiles: 480\n"),
        ("points: 512\n", "points: 1024\n"),
    ):
        assert old in quick
        larger = larger.replace(old, new)
    found["24 specimens of three parts, 8 scans of 480 × 1024 each"] = larger
    paths = {}
    for number, (name, text) in enumerate(found.items()):
        paths[name] = folder / f"{number}.yaml"
        paths[name].write_text(text)
    for profiles, points in ((500, 1024), (1000, 2048)):
        many = folder / f"many{profiles}"
        many.mkdir()
        paths[f"one car door, 200 scans of {profiles} × {points}"] = recipe_in(
            many, profiles=profiles, points=points, parts="  - builtin: car_door",
            work="scans: 200",
        )  # fmt: skip
    return paths


def main() -> None:
    """Print the tables, or with --one a single size's figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--one", type=int, nargs=2, metavar=("PROFILES", "POINTS"))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--facet-um", type=float, default=FACET_UM, help="of the car door")
    parser.add_argument("--turns", type=int, default=3)
    arguments = parser.parse_args()
    if arguments.one:
        door = DOOR.format(arguments.facet_um)
        cost = scan_cost(*arguments.one, rounds=arguments.rounds, part=door)
        print(json.dumps(dataclasses.asdict(cost)))
        return
    for size in SIZES:
        cost = scan_cost_alone(*size, rounds=arguments.rounds)
        print(f"{cost.profiles} × {cost.points}: {cost.wall_s:.3f} s", cost)
    with tempfile.TemporaryDirectory() as folder:
        for name, recipe in batches(Path(folder)).items():
            print(name, batch_cost(name, recipe, turns=arguments.turns))


if __name__ == "__main__":
    main()
