"""Whole datasets: with 1 and 2 jobs by the clock, what jobs add, and what the plan costs."""

import importlib.util
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.end_to_end import HOME, recipe_in
from pipeline.batch.backend import THREADS


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
        Until the processes share the shards: modules, parts, what all of them need.
    """

    name: str
    processor_s: dict[int, float]
    serial_s: float

    @property
    def each_job_s(self) -> float:
        """Processor seconds that each further job adds: its loops, trees and copied memory."""
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
    """Generate a recipe's dataset by 1 job and by `MANY_JOBS`, and only until its first shard."""
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
import os, sys
from pathlib import Path
from pipeline.batch.backend import Backend
from pipeline.batch import run
from pipeline.recipe import Recipe
results = Backend.results
def stop_at_shards(self, task, each):
    if task is not run.make_shard:
        return results(self, task, each)
    spent = os.times()
    print(spent.user + spent.system + spent.children_user + spent.children_system)
    raise SystemExit
Backend.results = stop_at_shards
run.generate(Recipe.load(sys.argv[1]), Path(sys.argv[2]), backend=Backend(jobs=2))
"""


def _serial_s(recipe: Path, out: Path) -> float:
    """Return processor seconds until processes share the shards; all parts count in full."""
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
