"""Cases of the bench: which formula, on which part, how strong; and their recordings."""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

from benchmarks.other_formulas.formulas import BY_NAME, CATALOGUED, LAWS, OUTSIDE
from benchmarks.other_formulas.formulas.base import Formula
from benchmarks.other_formulas.formulas.laws import true_parameters
from benchmarks.other_formulas.instrument import SPECKLE_SHARE, Instrument, Scan, draw_instrument
from benchmarks.other_formulas.parts import PARTS, plate
from benchmarks.other_formulas.shot import Shot, View, wobble
from benchmarks.other_formulas.speckle import Noise, speckle_kernel
from benchmarks.other_formulas.strength import Hidden, mounting_signal, signal_to_noise
from sensors.casting.scene import Scene
from sensors.recording import Recording

POPULATIONS = {"calibration": range(0, 100), "validation": range(100, 200), "test": range(200, 300)}
"""Seeds of each population. Calibration may be opened by anybody; test is judged in aggregate."""
STRENGTHS = ((6, True), (12, True), (24, False))
"""Whitened signal to noise, and whether baseline recordings are given."""
NULLS, PAIRS, OUTSIDE_EACH, LAWS_EACH = 100, 16, 2, 30
RECORDINGS, MOUNTED, BASELINES = 3, 5, 3
_CLOSE, _ALLOWED = 0.05, 0.4
"""Aimed at and allowed departure from the wanted signal to noise: few flipped readings at edges
jump."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Case:
    """One case; everything in its recordings follows from it.

    Attributes
    ----------
    name : of its folder
    kind : null, one, pair, outside, law or habit, which baselines have as well
    formulas : by name
    wanted : whitened signal to noise of each; 0 where the size is given
    baselines : whether recordings of the good instrument are given
    """

    name: str
    kind: str
    formulas: tuple[str, ...]
    wanted: int
    part: str
    baselines: bool
    plate: bool
    seed: int


def plan(seed: int) -> list[Case]:
    """List the cases of a seed; any first part of the list has all kinds in proportion."""
    rng = np.random.default_rng([seed, 36])
    groups: list[list[tuple[str, tuple[Formula, ...], int, bool]]] = [
        [("one", (f,), wanted, given) for wanted, given in STRENGTHS for f in CATALOGUED],
        [("null", (), 0, bool(k % 2)) for k in range(NULLS)],
        [("outside", (f,), 24, True) for f in OUTSIDE for _ in range(OUTSIDE_EACH)],
        [("pair", _pair(rng), 12, True) for _ in range(PAIRS)],
    ]
    return _drawn(groups, rng)


def plan_of_laws(seed: int) -> list[Case]:
    """List cases made by the catalogue's own laws, 300 of them, for the coverage of intervals."""
    laws: list[tuple[str, tuple[Formula, ...], int, bool]] = [
        ("law", (f,), 24, True) for _ in range(LAWS_EACH) for f in LAWS
    ]
    return _drawn([laws], np.random.default_rng([seed, 37]))


def plan_of_habits(seed: int) -> list[Case]:
    """List cases in which baselines have what the recordings have: nothing has changed."""
    habits: list[tuple[str, tuple[Formula, ...], int, bool]] = [
        ("habit", (f,), 24, True) for f in (*CATALOGUED, *OUTSIDE)
    ]
    return _drawn([habits], np.random.default_rng([seed, 38]))


PLANS = {"mixed": plan, "laws": plan_of_laws, "habits": plan_of_habits}


def _drawn(
    groups: list[list[tuple[str, tuple[Formula, ...], int, bool]]], rng: np.random.Generator
) -> list[Case]:
    """Mix the groups evenly and draw each case's part and seed."""
    places, cases = [], []
    for group in groups:
        order = rng.permutation(len(group))
        places += [((k + rng.random()) / len(group), group[i]) for k, i in enumerate(order)]
    for number, (_, (kind, chosen, wanted, given)) in enumerate(sorted(places, key=lambda p: p[0])):
        allowed = [p for p in PARTS if all(not f.parts or p in f.parts for f in chosen)]
        cases.append(
            Case(
                name=f"{kind}-{number + 1:03d}", kind=kind,
                formulas=tuple(f.name for f in chosen),
                wanted=wanted if all(f.scaled for f in chosen) else 0,
                part=str(rng.choice(allowed)), baselines=given,
                plate=bool(rng.random() < 0.5) or any(f.needs_plate for f in chosen),
                seed=int(rng.integers(2**31)),
            )
        )  # fmt: skip
    return cases


def _pair(rng: np.random.Generator) -> tuple[Formula, ...]:
    """Two formulas of two causes that share a part, neither of them a mounting's."""
    usable = [f for f in CATALOGUED if f.scaled and f.effect != "pose_error"]
    while True:
        one, two = (usable[k] for k in rng.choice(len(usable), 2, replace=False))
        parts = set(one.parts or PARTS) & set(two.parts or PARTS)
        if parts and one.effect != two.effect and one.slow == two.slow:
            return one, two


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Staged:
    """A case with its instrument and scans, and the formulas' sizes found."""

    case: Case
    scene: Scene
    instrument: Instrument
    scans: list[Scan]
    baseline_scans: list[Scan]
    plate_scan: Scan
    noise: Noise
    sizes: tuple[float, ...]
    reached: float


def stage(case: Case) -> Staged:
    """Draw a case's instrument and part, and scale its formulas to their signal to noise.

    Raises
    ------
    ValueError
        Where no size reaches the wanted signal to noise.
    """
    rng = np.random.default_rng([case.seed, 1])
    scene = PARTS[case.part](np.random.default_rng([case.seed, 2]))
    chosen = [BY_NAME[name] for name in case.formulas]
    instrument = draw_instrument(rng, slow=any(f.slow for f in chosen))
    mounted = any(f.effect == "pose_error" for f in chosen)
    scans = instrument.scans(rng, MOUNTED if mounted else RECORDINGS)
    noise = Noise(
        kernel=speckle_kernel(float(rng.uniform(0.6, 1.1)), float(rng.uniform(0.1, 0.35))),
        share=SPECKLE_SHARE,
    )
    staged = Staged(
        case=case, scene=scene, instrument=instrument, scans=scans,
        baseline_scans=instrument.scans(rng, BASELINES),
        plate_scan=instrument.scans(rng, 1)[0], noise=noise,
        sizes=(1.0,) * len(chosen), reached=0.0,
    )  # fmt: skip
    if not case.wanted:
        return staged
    nominal = [nominal_shot(staged, scan, k) for k, scan in enumerate(scans[:-1])]
    hidden = [Hidden(shot) for shot in nominal]
    found = [_sized(f, hidden, nominal, case) for f in chosen]
    return replace(staged, sizes=tuple(s for s, _ in found), reached=min(r for _, r in found))


def _sized(
    formula: Formula, hidden: list[Hidden], nominal: list[Shot], case: Case
) -> tuple[float, float]:
    """Find the size with the wanted signal to noise over the fitted recordings.

    Returns
    -------
    size, reached : float
    """
    measure = mounting_signal if formula.effect == "pose_error" else signal_to_noise

    def reached(size: float) -> float:
        return measure(hidden, [formula.apply(shot, size, case.seed) for shot in nominal])

    low, high, size, best = 1e-4, 100.0, 1.0, (1.0, 0.0)
    for _ in range(24):
        now = reached(size)
        if abs(now - case.wanted) < abs(best[1] - case.wanted):
            best = size, now
        if abs(now / case.wanted - 1) < _CLOSE:
            return best
        low, high = (size, high) if now < case.wanted else (low, size)
        size = float(np.clip(size * case.wanted / max(now, 1e-9), size / 8, size * 8))
        if not low < size < high:
            size = float(np.sqrt(low * high))
    if abs(best[1] / case.wanted - 1) < _ALLOWED:
        return best
    raise ValueError(f"{formula.name} on {case.part}: no size has signal to noise {case.wanted}")


def nominal_shot(staged: Staged, scan: Scan, index: int, scene: Scene | None = None) -> Shot:
    """Return a recording of the good instrument."""
    view = View(scene=scene or staged.scene, instrument=staged.instrument, scan=scan)
    return Shot(view=view, index=index, mean=view.depth + wobble(view), noise=staged.noise)


def record(staged: Staged, shot: Shot, name: str, number: int) -> Recording:
    """Draw a recording's readings."""
    scan, sheet = shot.view.scan, staged.instrument.sheet
    depth = shot.sample(np.random.default_rng([staged.case.seed, 3, number]))
    x = shot.view.laser.x_mm if sheet.columns == "even_x" else None
    bright = shot.intensity
    if bright is not None:
        bright = np.where(np.isfinite(depth), bright, np.nan)
    return Recording(
        name=name, depth_mm=depth, intensity=bright, poses=scan.poses, time_s=scan.time_s,
        start_time_s=scan.start_s, x_mm=x,
    )  # fmt: skip


def write(staged: Staged, folder: Path) -> dict[str, Any]:
    """Write what a stranger gets into a folder; return what it hides."""
    folder.mkdir(parents=True, exist_ok=True)
    case, habit = staged.case, staged.case.kind == "habit"
    chosen = [BY_NAME[name] for name in case.formulas]
    hidden = [] if habit else chosen

    def changed(scan: Scan, index: int) -> Shot:
        shot = nominal_shot(staged, scan, index)
        for formula, size in zip(chosen, staged.sizes, strict=True):
            shot = formula.apply(shot, size, case.seed)
        return shot

    for k, scan in enumerate(staged.scans):
        record(staged, changed(scan, k), f"rec-{k}", k).save(folder / f"rec-{k}.h5")
    if case.baselines:
        for k, scan in enumerate(staged.baseline_scans):
            shot = changed(scan, k) if habit else nominal_shot(staged, scan, k)
            record(staged, shot, f"base-{k}", 50 + k).save(folder / f"base-{k}.h5")
    if case.plate:
        shot = nominal_shot(staged, staged.plate_scan, 0, plate())
        record(staged, shot, "plate", 90).save(folder / "plate.h5")
    trimesh.Trimesh(staged.scene.vertices_mm, staged.scene.faces, process=False).export(
        folder / "part.stl"
    )
    (folder / "sensor.yaml").write_text(yaml.safe_dump(staged.instrument.stated(), sort_keys=False))
    return {
        **asdict(case),
        "effects": [f.effect for f in hidden if f.effect],
        "also": [list(f.also) for f in hidden if f.effect],
        "sizes": list(staged.sizes),
        "parameters": {
            f.effect: true_parameters(f.name, size, case.seed)
            for f, size in zip(chosen, staged.sizes, strict=True)
            if f in LAWS
        },
        "reached": staged.reached,
        "left_out": list(staged.instrument.left_out),
        "noise_um": 1e3 * staged.instrument.noise_mm,
    }


def save_truth(truth: dict[str, Any], file: Path) -> None:
    """Write what a case hides."""
    file.write_text(json.dumps(truth, indent=1))
