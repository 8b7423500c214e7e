r"""What good instruments depart by: learn it from the calibration population and keep it.

    flawforge challenge calibrate --out out/calibration --each 0
    python -m benchmarks.discrepancy out/calibration --simulated 15 \
        --write diagnosis/discrepancy.json

Only good instruments are used: folders whose truth hides nothing. Each gives, for each component
of the diagnosis, the likelihood of each size; the mixing distribution over sizes is kept.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from diagnosis.evidence.assess import good_factors, seen
from diagnosis.evidence.population import mixed
from diagnosis.prepare import Inputs, prepared
from diagnosis.workspace import Model
from pipeline.parts.part import load_part
from sensors.datasheet import Datasheet
from sensors.recording import Recording
from tests.support.small_parts import VIEWS, datasheet, part, record

SIMULATED = ("domes", "steps", "bowl", "wedge", "valley")


def good_folders(root: Path) -> Iterator[Path]:
    """Yield the folders of a calibration population whose truth hides nothing."""
    for file in sorted(root.glob("*/truth.json")):
        truth = json.loads(file.read_text(encoding="utf-8"))
        population = truth.get("population", "calibration")
        if "calibration" not in str(population):
            raise ValueError(f"{file}: population {population} may not set the diagnosis")
        hidden = truth.get("secret", truth)
        if hidden.get("kind") == "null":
            yield file.parent


def factors_of(folder: Path) -> dict[str, np.ndarray]:
    """Likelihood of each size of each component in one good instrument's recordings."""
    part = load_part(folder / "part.stl")
    files = sorted([*folder.glob("rec-*.h5"), *folder.glob("[abc].h5")])
    ready = prepared(
        Inputs(
            recordings=[Recording.load(f) for f in files], vertices_mm=part.vertices_mm,
            faces=part.faces, datasheet=Datasheet.load(folder / "sensor.yaml"),
            references=[Recording.load(f) for f in sorted(folder.glob("plate*.h5"))],
        ),
        [], lambda _: None,
    )  # fmt: skip
    return good_factors(seen([p for p in ready.patches if p.fit.any()], ready.noise, Model()))


def simulated(seed: int) -> dict[str, np.ndarray]:
    """Likelihood of each size in recordings that the plain simulator made: Perlin speckle."""
    name = SIMULATED[seed % len(SIMULATED)]
    scene, sheet = part(name), datasheet(100)
    made = [
        record(scene, sheet, [], name=f"r{k}", seed=1000 + 10 * seed + k, profiles=72,
               pitch_mm=0.6, **view)
        for k, view in enumerate(VIEWS)
    ]  # fmt: skip
    ready = prepared(
        Inputs(
            recordings=made, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=sheet
        ),
        [], lambda _: None,
    )  # fmt: skip
    return good_factors(seen([p for p in ready.patches if p.fit.any()], ready.noise, Model()))


def main() -> None:
    """Learn and write the population."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("roots", nargs="+", type=Path, help="folders of calibration sets")
    parser.add_argument(
        "--simulated", type=int, default=0, metavar="N", help="and N of the plain simulator"
    )
    parser.add_argument("--write", type=Path, required=True, metavar="FILE.json")
    args = parser.parse_args()
    found: dict[str, list[np.ndarray]] = {}
    names = []
    for root in args.roots:
        folders = list(good_folders(root))
        names.append(f"{root.name}: {len(folders)} good instruments")
        for folder in folders:
            print(folder, flush=True)
            for name, factors in factors_of(folder).items():
                found.setdefault(name, []).append(factors)
    for seed in range(args.simulated):
        for name, factors in simulated(seed).items():
            found.setdefault(name, []).append(factors)
    if args.simulated:
        names.append(f"simulated: {args.simulated} calibration instruments")
    args.write.write_text(written(found, "; ".join(names)), encoding="utf-8")


def written(found: dict[str, list[np.ndarray]], population: str) -> str:
    """Return the file's text: for each component the probability of each size."""
    components = {n: [round(float(w), 6) for w in mixed(f)] for n, f in sorted(found.items())}
    return json.dumps({"population": population, "components": components}, indent=1) + "\n"


if __name__ == "__main__":
    main()
