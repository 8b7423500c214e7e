"""Run the reliability campaign: `python -m benchmarks.campaign --recipes 1000 --inputs 500 ...`.

Every case is drawn from its own seed, so that a fault can be made again with `--only KIND --seed N
--first K`. What went wrong is kept in --faults, beside a summary of each kind of cases.
`--only KIND` runs a part; --write makes the table of all summaries there.
"""

import argparse
import importlib
import json
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.campaign import damage, inputs, meshes, recipes
from benchmarks.campaign.page import summarise, table
from benchmarks.campaign.sandbox import Outcome
from tests.support.small_recipe import write_shards

LOADED = (
    "pandas", "scipy.optimize", "pipeline.batch.run", "sensors.effects", "diagnosis.diagnose",
    "sensors.formats.conversion", "sensors.formats.motion", "flawforge.commands.roughness",
    "flawforge.commands.import_", "flawforge.commands.generate", "flawforge.commands.diagnose",
)  # fmt: skip
KINDS = ("recipes", "inputs", "meshes", "flips", "kills")


def main() -> int:
    """Run what is asked for; exit code 1 where something ended badly."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for kind, count in zip(KINDS, (1000, 500, 200, 1000, 200), strict=True):
        parser.add_argument(f"--{kind}", type=int, default=count, metavar="N")
    parser.add_argument("--only", choices=KINDS, help="this kind alone")
    parser.add_argument("--seed", type=int, default=None, help="default: of the clock")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--mesh-folder", type=Path, help="public meshes to try besides")
    parser.add_argument("--faults", type=Path, default=Path("out/campaign"))
    parser.add_argument("--write", type=Path, help="page to write the table into")
    asked = parser.parse_args()
    seed = int(time.time()) if asked.seed is None else asked.seed
    asked.faults.mkdir(parents=True, exist_ok=True)
    _warm()

    well = True
    for kind in [asked.only] if asked.only else KINDS:
        count = getattr(asked, kind)
        found: list[Outcome] = []
        started = time.monotonic()
        for number, outcome in _cases(kind, count, seed, asked):
            found.append(outcome)
            if outcome.fault:
                _keep(asked.faults, kind, seed, number, outcome)
            if len(found) % 50 == 0:
                print(f"{kind}: {len(found)} of {count}, {dict(Counter(o.fault for o in found))}",
                      file=sys.stderr, flush=True)  # fmt: skip
        summarise(asked.faults, kind, found, seed)
        well = well and not any(outcome.fault for outcome in found)
        print(f"{kind}: {len(found)} cases, {time.monotonic() - started:.0f} s, "
              f"{dict(Counter(o.fault or 'well' for o in found))}", flush=True)  # fmt: skip
    if asked.write is not None:
        table(asked.write, asked.faults)
    return int(not well)


def _warm() -> None:
    """Load and compile once what every child needs."""
    for name in LOADED:
        importlib.import_module(name)
    from pipeline.batch.run import generate
    from pipeline.recipe import Recipe

    with tempfile.TemporaryDirectory() as folder:
        generate(Recipe.load(write_shards(Path(folder))), Path(folder) / "out")


def _cases(
    kind: str, count: int, seed: int, asked: argparse.Namespace
) -> Iterator[tuple[int, Outcome]]:
    if kind == "flips":
        yield from _flips(count, seed, asked.first)
        return
    if kind == "kills":
        yield from _kills(count, seed)
        return
    extra: list[Path] = []
    if kind == "meshes":
        extra = meshes.shipped()
        if asked.mesh_folder is not None:
            found = (path for path in asked.mesh_folder.rglob("*"))
            extra += sorted(p for p in found if p.suffix.lower() in meshes.SUFFIXES)
        for number, path in enumerate(extra):
            yield -1 - number, _in_folder(lambda folder, path=path: meshes.of_file(folder, path))
    make: Callable[[Path, np.random.Generator], Outcome] = {
        "recipes": recipes.case, "inputs": inputs.case, "meshes": meshes.case,
    }[kind]  # fmt: skip
    for number in range(asked.first, asked.first + count):
        rng = np.random.default_rng([seed, KINDS.index(kind), number])
        yield number, _in_folder(lambda folder, rng=rng: make(folder, rng))


def _in_folder(run: Callable[[Path], Outcome]) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        return run(Path(folder))


def _flips(count: int, seed: int, first: int) -> Iterator[tuple[int, Outcome]]:
    from pipeline.batch.run import generate
    from pipeline.recipe import Recipe

    with tempfile.TemporaryDirectory() as folder:
        recipe = write_shards(Path(folder))
        generate(Recipe.load(recipe), Path(folder) / "out")
        for number in range(first, first + count):
            rng = np.random.default_rng([seed, KINDS.index("flips"), number])
            yield number, damage.flip(Path(folder) / "out", rng)


def _kills(count: int, seed: int) -> Iterator[tuple[int, Outcome]]:
    """Count kills, not runs."""
    from pipeline.batch.run import generate
    from pipeline.recipe import Recipe

    done, number = 0, 0
    with tempfile.TemporaryDirectory() as folder:
        reference = Path(folder) / "reference"
        generate(Recipe.load(write_shards(reference)), reference / "out")
        while done < count:
            rng = np.random.default_rng([seed, KINDS.index("kills"), number])
            place = Path(folder) / "run"
            outcome = damage.killed(place, reference / "out", rng, jobs=1 + number % 2)
            shutil.rmtree(place, ignore_errors=True)
            done += outcome.code
            number += 1
            yield number, outcome


def _keep(folder: Path, kind: str, seed: int, number: int, outcome: Outcome) -> None:
    line = {"kind": kind, "seed": seed, "number": number, "fault": outcome.fault,
            "code": outcome.code, "seconds": round(outcome.seconds, 1),
            "words": outcome.words}  # fmt: skip
    with (folder / "faults.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    sys.exit(main())
