"""`challenge calibrate`: opened recordings of the instrument, which may set a diagnosis's scales.

Every number that a diagnosis learns from this instrument comes from here. A sealed set is drawn
from the operating system's entropy and shares no seed with this population.
"""

import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from challenge.cases.case import MAKES, SWITCHES, Secret, stage, write
from challenge.cases.nulls import check_null
from challenge.cases.parts import SHAPES
from challenge.cases.seeds import child
from challenge.cases.switches import SINGLE
from challenge.sets.processes import in_processes
from challenge.sets.sealed import write_whole

POPULATION = "challenge-1-calibration"
"""Name of this population, as a diagnosis states it beside the scales learnt from it."""
OF_MAKES = "challenge-makes-calibration"
"""Name of the same of instruments of other makes, whose files have nominal figures."""
SEEDS = {POPULATION: 1_000_001, OF_MAKES: 1_000_003}
NULLS = 30
_TRIES = 5


def planned(
    nulls: int = NULLS, each: int = 1, population: str = POPULATION
) -> dict[str, Secret]:
    """Return the sets by the names of their folders: nulls over all parts, then one effect each.

    Of other makes each second set has no reference plates, and each third no baselines; a coarse
    camera has none, either: its locking is no change.

    Parameters
    ----------
    each : sets of each effect
    population : `POPULATION` or `OF_MAKES`
    """
    shapes = list(SHAPES)
    sets = {}
    for k in range(nulls):
        sets[f"null-{k + 1:03d}"] = _secret("null", (), shapes[k % len(shapes)], 1)
    for turn in range(each):
        for k, name in enumerate(SINGLE):
            fitting = SWITCHES[name].shapes or tuple(shapes)
            folder = f"one-{name}" if turn == 0 else f"one-{name}-{turn + 1}"
            shape = fitting[(k + turn) % len(fitting)]
            sets[folder] = _secret("one", (name,), shape, 1 + (k + turn) % 2)
    seed = SEEDS[population]
    sets = {n: replace(s, seed=int(child(seed, n).integers(2**62))) for n, s in sets.items()}
    if population == OF_MAKES:
        sets = {
            name: replace(
                s, family=MAKES, plates=2 * (k % 2),
                baselines=2 * (k % 3 > 0 and "pixel_locking" not in s.switches),
            )
            for k, (name, s) in enumerate(sets.items())
        }
    return sets


def _secret(kind: str, switches: tuple[str, ...], shape: str, strength: int) -> Secret:
    return Secret(
        kind=kind, switches=switches, strength=strength, shape=shape, recordings=3, seed=0
    )


def calibrate(
    out: Path, *, nulls: int = NULLS, each: int = 1, jobs: int = 1, makes: bool = False
) -> int:
    """Make the population in a folder, one folder a set; continue where it was stopped.

    Parameters
    ----------
    makes
        Of instruments of other makes, not of the first family's.

    Returns
    -------
    int
        Exit code.
    """
    out.mkdir(parents=True, exist_ok=True)
    name_of = OF_MAKES if makes else POPULATION
    sets = planned(nulls, each, name_of)
    todo = [name for name in sets if not (out / name / "truth.json").exists()]
    print(f"{len(sets)} sets, {len(todo)} to make", flush=True)
    calls = [(out / name, sets[name]) for name in todo]
    for k, (folder, _) in enumerate(in_processes(_make_one, calls, jobs)):
        name = folder.name
        print(f"{name} ({k + 1} of {len(todo)})", flush=True)
    write_whole(out / "population.json", json.dumps(
        {"name": name_of, "seed": SEEDS[name_of], "sets": list(sets), "opened": True}, indent=1
    ).encode())  # fmt: skip
    return 0


def _make_one(folder: Path, secret: Secret) -> None:
    """Render one set; what it hides is written beside it, last."""
    shutil.rmtree(folder, ignore_errors=True)
    again = child(secret.seed, "again")
    for _ in range(_TRIES):
        try:
            staged = stage(secret)
            check = check_null(staged, secret) if secret.kind == "null" else None
        except ValueError:  # the part's booleans failed, or no pose avoids looking along walls
            staged, check = None, None
        if staged is not None and (check is None or check.holds_in(secret.family)):
            break
        secret = replace(secret, seed=int(again.integers(2**62)))
    else:
        raise RuntimeError(f"{folder.name}: {_TRIES} draws in a row were no valid set")
    write(secret, staged, folder)
    name = OF_MAKES if secret.family == MAKES else POPULATION
    known: dict[str, Any] = {"population": name, "secret": asdict(secret)}
    if check is not None:
        known["null"] = {k: float(v) for k, v in asdict(check).items()}
    write_whole(folder / "truth.json", json.dumps(known, indent=1).encode())
