r"""What good instruments depart by: learn it from the calibration population and keep it.

    flawforge challenge calibrate --out out/calibration --nulls 20 --each 0
    flawforge challenge calibrate --out out/makes --makes --nulls 48 --each 0
    python -m benchmarks.discrepancy out/calibration out/makes --simulated 40 --tolerances 40 \
        --jobs 2 --keep out/discrepancy --write diagnosis/discrepancy/discrepancy.json

It takes an hour or two; with `--keep` the same command continues from where it was stopped.
Only good instruments are used: folders whose truth hides nothing. Each gives, for each component
of the diagnosis, the likelihood of each size; the mixing distribution over sizes is kept. The same
is kept of changes, of what the other recordings have beside the first one, taken as a baseline, and
how often the next recordings depart in another way; and of the third beside the
first two, how often a change is as the one before.
Each population is a kind of instruments of its own; with `--makes` each is of another make.
Each population is told by the others: by how much further sizes lie apart in yet another kind, by
aspect. With `--left-out` it says how well, and how often an instrument is of another kind, by that.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Memory, Parallel, delayed
from scipy.special import logsumexp

from benchmarks.good_instruments import (
    Factors,
    Make,
    beside,
    departures,
    inputs_of,
    simulated,
)
from benchmarks.other_formulas.tolerances import good_instrument
from challenge.commit import commit
from challenge.sets.calibration_population import OF_MAKES
from diagnosis.discrepancy.good_instrument import evidence
from diagnosis.discrepancy.learning import APART, learnt, learnt_alike, learnt_apart, learnt_changes
from diagnosis.discrepancy.population import ASPECTS, Kind, Population, aspect_of
from sensors.datasheet import Datasheet

UNLIKE = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
"""Shares of instruments of another kind that are weighed."""


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
    parser.add_argument(
        "--keep", type=Path, metavar="DIR",
        help="keep there what each instrument shows, by the commit that looked at it",
    )  # fmt: skip
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
    kept = Memory(None if args.keep is None else args.keep / commit(), verbose=0).cache
    work = Parallel(n_jobs=args.jobs)
    shown = [work(delayed(kept(departures))(make) for make in g.instruments) for g in groups]
    departing = learnt(shown)
    known = Population(kinds=tuple(
        Kind(name=g.name, makes=g.makes, instruments=len(g.instruments), columns=g.columns,
             weights=w)
        for g, w in zip(groups, departing, strict=True)
    ))  # fmt: skip
    apart = left_out(known, shown, [{"apart_by": dict.fromkeys(ASPECTS, by)} for by in APART])
    known = replace(known, apart_by=learnt_apart(apart))
    if args.left_out:
        shares = left_out(known, shown, [{"share": share} for share in UNLIKE])
        print("By the share of instruments of another kind:", table(UNLIKE, shares),
              "By how much further sizes lie apart in another kind:", table(APART, apart),
              sep="\n")  # fmt: skip
    look = delayed(kept(beside))
    later = [work(look(make, known, 1) for make in group.instruments) for group in groups]
    changing = learnt_changes([
        [one.factors_of_change(kind) for one in shown]
        for shown, kind in zip(later, known.kinds, strict=True)
    ])  # fmt: skip
    third = work(look(make, known, 2) for make in recorded)
    known = replace(known, kinds=tuple(
        replace(k, changes=c, anew=a) for k, (c, a) in zip(known.kinds, changing, strict=True)
    ))  # fmt: skip
    known = replace(known, alike=learnt_alike([one.factors_alike(known) for one in third]))
    args.write.write_text(written(known), encoding="utf-8")


@dataclass(frozen=True, kw_only=True, slots=True)
class _Group:
    """Good instruments of one kind, of so many makes."""

    name: str
    makes: int
    columns: str
    instruments: Sequence[Make]


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


Told = Mapping[tuple[str, str], np.ndarray]
"""Log probability of what a population shows, for each value that is weighed, by its name and by
aspect."""


def left_out(
    known: Population, shown: Sequence[Sequence[Factors]], ways: Sequence[Mapping[str, Any]]
) -> Told:
    """Tell each population by the others.

    Parameters
    ----------
    shown : of each kind, each instrument's log factors of sizes, by component
    ways : what is weighed: attributes of the population of the others
    """
    names = [k.name.partition(",")[0].partition(":")[0] for k in known.kinds]
    told = {}
    for name in dict.fromkeys(names):
        own = [k == name for k in names]
        kinds = tuple(k for k, out in zip(known.kinds, own, strict=True) if not out)
        others = [replace(known, kinds=kinds, **way) for way in ways]
        instruments = [i for group, out in zip(shown, own, strict=True) if out for i in group]
        for aspect in ASPECTS:
            told[name, aspect] = np.array(
                [sum(_nats_of(one, i, aspect) for i in instruments) for one in others]
            )
    return told


def table(values: Sequence[float], told: Told) -> str:
    """Write what tells each population by the others, in nats over the first value."""
    rows = ["| left out | aspect | " + " | ".join(f"{v:.2f}" for v in values) + " |",
            "| --- " * (len(values) + 2) + "|"]  # fmt: skip
    for (name, aspect), nats in told.items():
        if np.ptp(nats) > 0:
            cells = [f"{n:+.1f}" for n in nats - nats[0]]
            rows.append(f"| {name} | {aspect} | {' | '.join(cells)} |")
    return "\n".join(rows)


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
    apart_by = {aspect: round(by, 6) for aspect, by in population.apart_by.items()}
    return json.dumps({"alike": alike, "apart_by": apart_by, "kinds": kinds}, indent=1) + "\n"


if __name__ == "__main__":
    main()
