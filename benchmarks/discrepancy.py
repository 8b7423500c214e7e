r"""What good instruments depart by: learn it from the calibration population and keep it.

    flawforge challenge calibrate --out out/calibration --each 0
    python -m benchmarks.discrepancy out/calibration --simulated 15 \
        --write diagnosis/discrepancy/discrepancy.json

Only good instruments are used: folders whose truth hides nothing. Each gives, for each component
of the diagnosis, the likelihood of each size; the mixing distribution over sizes is kept. Each
population is a kind of instruments of its own.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from diagnosis.claims.plate_noise import level_change
from diagnosis.discrepancy.good_instrument import mean_factors, rate_factors
from diagnosis.discrepancy.population import learnt
from diagnosis.evidence.noise_level import AGAINST_PLATES, level_factors, level_unsure
from diagnosis.evidence.seen import channels_seen, seen
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.prepare import Inputs, Prepared, prepared
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
    print(folder, flush=True)
    ready = prepared(
        Inputs(
            recordings=[Recording.load(f) for f in files], vertices_mm=part.vertices_mm,
            faces=part.faces, datasheet=Datasheet.load(folder / "sensor.yaml"),
            references=[Recording.load(f) for f in sorted(folder.glob("plate*.h5"))],
        ),
        [], lambda _: None,
    )  # fmt: skip
    return _factors(ready)


def _factors(ready: Prepared) -> dict[str, np.ndarray]:
    patches = [p for p in ready.patches if p.fit.any()]
    one = seen(patches, ready.noise, Model())
    channels = channels_seen(patches, ready.noise, Model(), one)
    found = mean_factors(one) | rate_factors(channels.values())
    if ready.nominal is not None:
        ws = Workspace.build(patches, ready.noise)
        change = level_change(ws, Model(), ready.nominal.sd_mm)
        unsure = np.hypot(change.unsure, level_unsure(ready.nominal))
        found[AGAINST_PLATES] = level_factors(change.log, float(unsure))
    return found


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
    return _factors(ready)


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
    names, made = [], []
    for root in args.roots:
        folders = list(good_folders(root))
        names.append(f"{root.name}: {len(folders)} good instruments")
        made.append([factors_of(folder) for folder in folders])
    if args.simulated:
        names.append(f"simulated: {args.simulated} calibration instruments")
        made.append([simulated(seed) for seed in range(args.simulated)])
    args.write.write_text(written(names, made), encoding="utf-8")


def written(names: Sequence[str], made: Sequence[Sequence[Mapping[str, np.ndarray]]]) -> str:
    """Return the file's text: for each component of each kind the probability of each size."""
    kinds = [
        {"name": name, "components": {n: [round(float(w), 6) for w in f]
                                      for n, f in sorted(found.items())}}
        for name, found in zip(names, learnt(made), strict=True)
    ]  # fmt: skip
    return json.dumps({"kinds": kinds}, indent=1) + "\n"


if __name__ == "__main__":
    main()
