r"""What good instruments depart by: learn it from the calibration population and keep it.

    flawforge challenge calibrate --out out/calibration --nulls 20 --each 0
    flawforge challenge calibrate --out out/makes --makes --nulls 48 --each 0
    python -m benchmarks.discrepancy out/calibration out/makes --simulated 40 --tolerances 40 \
        --jobs 2 --write diagnosis/discrepancy/discrepancy.json

Only good instruments are used: folders whose truth hides nothing. Each gives, for each component
of the diagnosis, the likelihood of each size; the mixing distribution over sizes is kept. The same
is kept of changes, of what the other recordings have beside the first one, taken as a baseline, and
how often the next recordings depart as another instrument's would; and of the third beside the
first two, how often a change is as the one before.
Each population is a kind of instruments of its own; with `--makes` each is of another make.
With `--left-out` each population is told by the others: how often an instrument is of yet another
kind, by that.
"""

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from scipy.special import logsumexp

from benchmarks.other_formulas.tolerances import good_instrument
from challenge.sets.calibration_population import OF_MAKES
from diagnosis.claims.lay import LAY, lay_of
from diagnosis.claims.plate_noise import level_change
from diagnosis.data.patch import all_fitted
from diagnosis.discrepancy.good_instrument import (
    change_factors,
    evidence,
    informed,
    kinds_of,
    mean_factors,
    next_changes,
    rate_factors,
)
from diagnosis.discrepancy.learning import (
    factors_alike,
    factors_of_change,
    learnt,
    learnt_alike,
    learnt_changes,
)
from diagnosis.discrepancy.population import ASPECTS, Kind, Population, aspect_of
from diagnosis.evidence.long_waves import long_wave_factors
from diagnosis.evidence.noise_level import AGAINST_PLATES, level_factors, level_unsure
from diagnosis.evidence.seen import channels_seen, seen
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.laws_at_edges import factors_at_edges, shown_at_edges
from diagnosis.prepare import Inputs, Prepared, prepared
from diagnosis.usual_sizes import changes_among
from pipeline.parts.part import load_part
from sensors.datasheet import Datasheet
from sensors.recording import Recording
from tests.support.small_parts import VIEWS, datasheet, part, record

SIMULATED = ("domes", "steps", "bowl", "wedge", "valley")
UNLIKE = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
"""Shares of instruments of another kind that are weighed."""
STEPS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)
"""Scales by which sizes lie further apart in another kind that are weighed."""


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


Factors = Mapping[str, np.ndarray]


def inputs_of(folder: Path) -> Inputs:
    """Read the recordings and the plates of a good instrument."""
    part = load_part(folder / "part.stl")
    files = sorted([*folder.glob("rec-*.h5"), *folder.glob("[abc].h5")])
    print(folder, flush=True)
    return Inputs(
        recordings=[Recording.load(f) for f in files], vertices_mm=part.vertices_mm,
        faces=part.faces, datasheet=Datasheet.load(folder / "sensor.yaml"),
        references=[Recording.load(f) for f in sorted(folder.glob("plate*.h5"))],
    )  # fmt: skip


def departures(inputs: Inputs) -> Factors:
    """Likelihood of each size of each component in one good instrument's recordings."""
    ready = prepared(inputs, [], lambda _: None)
    patches = [p for p in ready.patches if p.fit.any()]
    one = seen(patches, ready.noise, Model())
    channels = channels_seen(patches, ready.noise, Model(), one)
    found = mean_factors(one) | rate_factors(channels.values())
    ws = Workspace.build(patches, ready.noise)
    found |= long_wave_factors(ws)
    if ready.nominal is not None:
        change = level_change(ws, Model(), ready.nominal.sd_mm)
        unsure = np.hypot(change.unsure, level_unsure(ready.nominal))
        found[AGAINST_PLATES] = level_factors(change.log, float(unsure))
    laws = shown_at_edges(one.components, ws)
    return found | lay_factors(ready) | factors_at_edges(laws)


def lay_factors(ready: Prepared) -> Factors:
    """Likelihood of each size of the lay that the noise seems to have, where that can be seen."""
    if ready.nominal is None:
        return {}
    ws = Workspace.build(all_fitted(ready.patches), ready.noise)
    lay = lay_of(ws, Model(), ready.nominal, ready.baseline)
    return {} if lay is None else {LAY: lay[1]}


def changes(inputs: Inputs, population: Population, kind: Kind) -> Factors:
    """Likelihood of what others change beside the first recording, by component.

    See `factors_of_change`.

    Parameters
    ----------
    population : by which the first recording is a baseline
    kind : which the instrument is of
    """
    shown, _, found = beside(inputs, population, 1)
    return {
        name: factors_of_change(
            kind.weights[name], shown.get(name, np.zeros(factors.size)), factors
        )
        for name, factors in found.items()
        if name in kind.weights
    }


def again(inputs: Inputs, population: Population) -> Factors:
    """Likelihood of each share of changes that are as those before, by component.

    The first two recordings are baselines of the third.
    """
    shown, (among, laws), found = beside(inputs, population, 2)
    population = population.of_files(inputs.datasheet.columns)
    kinds = kinds_of(population, shown, good=True)
    both = next_changes(population, kinds, shown | laws, among)
    return {
        name: factors_alike(*both[name], found[name])
        for name in among.keys() & both.keys() & found.keys()
    }


def beside(
    inputs: Inputs, population: Population, count: int
) -> tuple[Factors, tuple[Factors, Factors], Factors]:
    """Look at later recordings beside the first ones as baselines.

    Returns
    -------
    likelihood of each size of each component in the first; of what they change among themselves,
    with what laws at edges do in them; of what the later ones change
    """
    first, later = inputs.recordings[:count], inputs.recordings[count:]
    ready = prepared(
        replace(inputs, recordings=later, holdout=first[:1], baselines=first), [], lambda _: None
    )
    patches = [p for p in ready.patches if p.fit.any()]
    now = seen(patches, ready.noise, Model())
    before = seen(ready.baseline, ready.noise, Model(), like=now)
    usual = channels_seen(ready.baseline, ready.noise, Model(), now)
    shown = mean_factors(before) | rate_factors(usual.values())
    population = population.of_files(inputs.datasheet.columns)
    own = informed(population, kinds_of(population, shown, good=True), shown)
    channels = channels_seen(patches, ready.noise, Model(), now)
    base, rest = (Workspace.build(part, ready.noise) for part in (ready.baseline, patches))
    found = {
        **change_factors(now, before, channels, usual, own),
        **lay_factors(ready),
        # what a recording shows of a law is its own edges', and says nothing of the next
        **factors_at_edges(shown_at_edges(now.components, rest, base)),
    }
    return shown, changes_among(ready, now, own), found


def simulated(seed: int) -> Inputs:
    """Make recordings by the plain simulator: Perlin speckle."""
    name = SIMULATED[seed % len(SIMULATED)]
    scene, sheet = part(name), datasheet(100)
    made = [
        record(scene, sheet, [], name=f"r{k}", seed=1000 + 10 * seed + k, profiles=72,
               pitch_mm=0.6, **view)
        for k, view in enumerate(VIEWS)
    ]  # fmt: skip
    return Inputs(
        recordings=made, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=sheet
    )


def main() -> None:
    """Learn and write the population."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("roots", nargs="+", type=Path, help="folders of calibration sets")
    parser.add_argument(
        "--simulated", type=int, default=0, metavar="N", help="and N of the plain simulator"
    )
    parser.add_argument(
        "--tolerances", type=int, default=0, metavar="N",
        help="and N whose light is as uneven as makers allow",
    )  # fmt: skip
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes")
    parser.add_argument(
        "--left-out", action="store_true", help="say how well each population is told by the others"
    )
    parser.add_argument("--write", type=Path, required=True, metavar="FILE.json")
    args = parser.parse_args()
    groups = [group for root in args.roots for group in _of_folders(root)]
    # simulated instruments are the same in each recording, and tell nothing of changes alike
    recorded = [make for group in groups for make in group.instruments]
    for name, count, make in (
        ("simulated", args.simulated, simulated), ("tolerances", args.tolerances, good_instrument),
    ):  # fmt: skip
        if count:
            instruments = [partial(make, seed) for seed in range(count)]
            label = f"{name}: {count} calibration instruments"
            groups.append(_Group(name=label, makes=1, columns="", instruments=instruments))
    work = Parallel(n_jobs=args.jobs)
    shown = [work(delayed(_departures_of)(make) for make in g.instruments) for g in groups]
    departing = learnt(shown)
    known = Population(kinds=tuple(
        Kind(name=g.name, makes=g.makes, instruments=len(g.instruments), columns=g.columns,
             weights=w)
        for g, w in zip(groups, departing, strict=True)
    ))  # fmt: skip
    if args.left_out:
        print(left_out(known, shown))
    changing = learnt_changes([
        work(delayed(_changes_of)(make, known, kind) for make in g.instruments)
        for g, kind in zip(groups, known.kinds, strict=True)
    ])  # fmt: skip
    known = Population(
        kinds=tuple(
            replace(k, changes=c, anew=a)
            for k, (c, a) in zip(known.kinds, changing, strict=True)
        )
    )
    alike = learnt_alike(work(delayed(_again)(make, known) for make in recorded))
    known = replace(known, alike=alike)
    args.write.write_text(written(known), encoding="utf-8")


@dataclass(frozen=True, kw_only=True, slots=True)
class _Group:
    """Good instruments of one kind, of so many makes."""

    name: str
    makes: int
    columns: str
    instruments: Sequence[Callable[[], Inputs]]


def _of_folders(root: Path) -> list[_Group]:
    """Instruments of a calibration population's folders.

    Those whose columns are rays are a kind, those with readings at even places another.
    """
    made = json.loads((root / "population.json").read_text(encoding="utf-8"))["name"]
    by_columns: dict[str, list[Path]] = {}
    for folder in good_folders(root):
        columns = Datasheet.load(folder / "sensor.yaml").columns
        by_columns.setdefault(columns, []).append(folder)
    return [
        _Group(
            name=f"{made}, {columns}: {len(folders)} good instruments",
            makes=len(folders) if made == OF_MAKES else 1,
            columns=columns,
            instruments=[partial(inputs_of, folder) for folder in folders],
        )
        for columns, folders in sorted(by_columns.items())
    ]


def _departures_of(make: Callable[[], Inputs]) -> Factors:
    return departures(make())


def _changes_of(make: Callable[[], Inputs], known: Population, kind: Kind) -> Factors:
    return changes(make(), known, kind)


def _again(make: Callable[[], Inputs], known: Population) -> Factors:
    return again(make(), known)


def left_out(known: Population, shown: Sequence[Sequence[Factors]]) -> str:
    """Tell each population by the others: nats over the first share, or step, of another kind.

    Parameters
    ----------
    shown : of each kind, each instrument's log factors of sizes, by component
    """
    names = [k.name.partition(",")[0].partition(":")[0] for k in known.kinds]
    rows, further = (
        ["| left out | aspect | " + " | ".join(f"{v:.2f}" for v in values) + " |",
         "| --- " * (len(values) + 2) + "|"]
        for values in (UNLIKE, STEPS)
    )  # fmt: skip
    for name in dict.fromkeys(names):
        own = [k == name for k in names]
        others = Population(
            kinds=tuple(k for k, out in zip(known.kinds, own, strict=True) if not out)
        )
        instruments = [i for group, out in zip(shown, own, strict=True) if out for i in group]
        for aspect in ASPECTS:
            for table, ways in (
                (rows, [replace(others, share=share) for share in UNLIKE]),
                (further, [replace(others, steps=steps) for steps in STEPS]),
            ):
                nats = np.array([sum(_nats_of(w, i, aspect) for i in instruments) for w in ways])
                if np.ptp(nats) > 0:
                    text = " | ".join(f"{n:+.1f}" for n in nats - nats[0])
                    table.append(f"| {name} | {aspect} | {text} |")
    return "\n".join([
        "By the share of instruments of another kind:", *rows,
        "By how much further sizes lie apart in another kind:", *further,
    ])  # fmt: skip


def _nats_of(others: Population, shown: Factors, aspect: str) -> float:
    """Log probability of what an instrument shows of an aspect."""
    nats = np.log(others.makes / others.makes.sum())
    for name, factors in shown.items():
        weights = others.weights(name) if aspect_of(name) == aspect else None
        if weights is not None:
            nats = nats + evidence(weights, factors)
    return float(logsumexp(nats))


def written(population: Population) -> str:
    """Return the file's text: for each component of each kind the probability of each size."""

    def rounded(weights: Factors) -> dict[str, list[float]]:
        return {n: [round(float(w), 6) for w in f] for n, f in sorted(weights.items())}

    kinds = [
        {"name": k.name, "makes": k.makes, "instruments": k.instruments, "columns": k.columns,
         "components": rounded(k.weights), "changes": rounded(k.changes),
         "anew": {n: round(w, 6) for n, w in sorted(k.anew.items())}}
        for k in population.kinds
    ]  # fmt: skip
    alike = {aspect: round(share, 6) for aspect, share in population.alike.items()}
    return json.dumps({"alike": alike, "kinds": kinds}, indent=1) + "\n"


if __name__ == "__main__":
    main()
