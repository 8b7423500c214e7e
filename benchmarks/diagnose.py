"""The development bench of the diagnosis: nulls, every effect at three strengths, withheld effects.

Recordings come from the plain simulator plus effects, so that this shows errors of the inference,
not of the physics. Strength is the whitened signal to noise over the recordings that are fitted,
the pose projected out: sqrt(2 x nats of the true law over the plain one); expected nats for bulk
physics, those of simulated recordings for what lives on depth edges, where poses are uncertain.

    python -m benchmarks.diagnose --out docs/diagnosis-bench.md [--nulls 60] [--minutes 30]
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import stats

from benchmarks.relief import VIEWS, datasheet, part, record
from diagnosis.diagnose import Diagnosis, diagnose
from diagnosis.edges import EDGE_COVARIATES
from diagnosis.heldout import judge
from diagnosis.locate import departure_mask
from diagnosis.maps import RIGID
from diagnosis.noise import NoiseModel, calibrate
from diagnosis.patch import cut
from diagnosis.prediction import predict
from diagnosis.registration import register
from diagnosis.score import CLIP, placements, whitened
from diagnosis.workspace import Model, Workspace
from sensors.effects import effect_of
from sensors.effects.base import Effect
from sensors.laser import Laser
from sensors.recording import Recording
from sensors.typed_yaml import RecipeError

POINTS, PROFILES, PITCH_MM = 100, 72, 0.6
STRENGTHS = (6, 12, 24)
# effect, its other parameters, the parameter that is scaled, its null, the part that shows it
CASES: tuple[tuple[str, dict[str, object], str, float, str], ...] = (
    ("line_bow", {}, "sag_um", 0.0, "domes"),
    ("lens_distortion", {"tilt_um": 0.0}, "cubic_um", 0.0, "domes"),
    ("range_scale", {}, "error_ppm", 0.0, "bowl"),
    ("incidence_bias", {"signed_um": 0.0}, "squared_um", 0.0, "domes"),
    ("volume_scattering", {}, "depth_um", 0.0, "domes"),
    ("stage_vibration", {"frequency_hz": 23.0}, "amplitude_um", 0.0, "wedge"),
    ("travel_ripple", {"period_mm": 6.0}, "amplitude_um", 0.0, "domes"),
    ("pixel_locking", {}, "amplitude_px", 0.0, "bowl"),
    ("column_offset", {"seed": 5}, "rms_um", 0.0, "bowl"),
    ("form_error", {}, "coefficients_um", 0.0, "wedge"),
    ("finite_spot", {}, "line_sd_um", 0.0, "steps"),
    ("edge_mixing", {}, "line_sd_um", 0.0, "steps"),
    ("interreflection", {"reach_mm": 5.0}, "weight", 0.0, "valley"),
    ("motion_blur", {}, "exposure_ms", 0.0, "steps"),
    ("incidence_noise", {}, "exponent", 0.0, "wedge"),
    ("camera_occlusion", {}, "triangulation_angle_deg", 0.0, "steps"),
    ("specular_dropout", {}, "share", 0.0, "domes"),
    ("random_dropout", {}, "share", 0.0, "wedge"),
    ("outlier_spikes", {"width_um": 300.0}, "share", 0.0, "bowl"),
)
PAIRS = (("line_bow", "outlier_spikes"), ("volume_scattering", "random_dropout"),
         ("stage_vibration", "incidence_noise"), ("range_scale", "column_offset"))  # fmt: skip
WITHHELD = ("pixel_locking", "stage_vibration", "volume_scattering", "camera_occlusion")


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """One case and what came out."""

    kind: str
    effect: str
    strength: int
    verdict: str
    found: tuple[str, ...]
    rivals: tuple[str, ...]
    error: float | None
    gain_share: float | None
    iou: float | None
    seconds: float


def entry(case: tuple[str, dict[str, object], str, float, str], scale: float) -> dict[str, object]:
    """Build the effect of a case with its parameter at a scale of its typical value."""
    name, more, parameter, _, _ = case
    kind = type(effect_of({"name": name}))
    described = kind.parameter(parameter)
    typical = described.typical
    if isinstance(typical, tuple):
        value: object = [scale * v for v in typical]
    else:
        value = float(np.clip(scale * float(typical or 1.0), described.low, described.high))  # type: ignore[arg-type]  # a number
    return {"name": name, **more, parameter: value}


def _recordings(name: str, effects: Sequence[dict[str, object]]) -> list[Recording]:
    """Two recordings, the same but for the effects in them."""
    return [
        record(
            part(name), datasheet(POINTS), effects, name=f"w{k}", seed=900 + k, profiles=PROFILES,
            pitch_mm=PITCH_MM, **view,
        )
        for k, view in enumerate(VIEWS[:2])
    ]  # fmt: skip


def bench_workspace(name: str) -> Workspace:
    """Two recordings of nothing, to measure strengths with."""
    sheet, scene = datasheet(POINTS), part(name)
    laser = Laser.from_datasheet(sheet)
    patches = []
    for k, made in enumerate(_recordings(name, [])):
        valid = np.isfinite(made.depth_mm)
        placed = register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.001)
        patches += cut(k, made, placed, scene, sheet, laser, lateral_mm=0.03)
    noise = calibrate(
        [p.depth_mm - p.plain_mm for p in patches],
        [np.isfinite(p.depth_mm - p.plain_mm) & ~p.edge for p in patches],
        pitch_mm=(0.44, PITCH_MM), missing_share=0.0, from_reference=False,
    )  # fmt: skip
    return Workspace.build(patches, replace(noise, tail_share=0.0))


def taken_with(ws: Workspace, name: str, effect: Effect) -> Workspace:
    """Return a part's `bench_workspace` with the recordings taken again with an effect in them."""
    made = _recordings(name, [effect.to_mapping()])
    patches = tuple(
        replace(p, depth_mm=r.depth_mm) for p, r in zip(ws.patches, made, strict=True)
    )
    return replace(ws, patches=patches)


def strength(ws: Workspace, effect: dict[str, object], part_name: str) -> float:
    """Whitened signal to noise of an effect: sqrt(2 x nats of its law over the plain one)."""
    thing = effect_of(dict(effect))
    if thing.undrawn():
        thing = thing.draw(np.random.default_rng(0))
    at_edges = thing.covariate in EDGE_COVARIATES
    nats = _simulated_nats(ws, thing, part_name) if at_edges else _expected_nats(ws, thing)
    return float(np.sqrt(2 * max(nats, 0.0)))


def _simulated_nats(ws: Workspace, thing: Effect, part_name: str) -> float:
    """Nats that the law of an effect gains on the bench's recordings, taken with it."""
    there = taken_with(ws, part_name, thing)
    plain, true = (there.log_densities(m) for m in (Model(), Model(effects=(thing,))))
    return float(there.block_scores([t - p for t, p in zip(true, plain, strict=True)]).sum())


def _expected_nats(ws: Workspace, thing: Effect) -> float:
    nats = 0.0
    base = ws.predict(Model())
    raw = [whitened(p, q, ws.noise) for p, q in zip(ws.patches, base, strict=True)]
    signals = []
    for patch, plain, state in zip(ws.patches, base, raw, strict=True):
        other = predict(patch.view, (thing,), ws.noise, softness=patch.softness)
        both = plain.seen & other.seen
        # at an edge one reading may be off by millimetres and still counts as one
        most = np.where(patch.edge, CLIP * plain.sd_mm, 0.3)
        change = np.where(both, np.nan_to_num(other.mean_mm) - np.nan_to_num(plain.mean_mm), 0.0)
        signals.append(
            replace(state, innovations=state.whiten(np.clip(change, -most, most)))
        )
        p, q = other.p_missing, plain.p_missing
        nats += float((p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q)))[plain.seen].sum())
        ratio = (other.sd_mm / plain.sd_mm)[both]
        ratio = ratio / np.exp(np.mean(np.log(ratio)))
        nats += float((0.5 * ratio**2 - 0.5 - np.log(ratio)).sum())
        o, b = other.p_outlier[both], plain.p_outlier[both]
        nats += float((o * np.log(o / b) + (1 - o) * np.log((1 - o) / (1 - b))).sum())
    moved = placements(ws.patches, signals, ws.masks())
    for patch, signal in zip(ws.patches, signals, strict=True):
        rest = signal.innovations - signal.columns @ moved[patch.recording]
        nats += 0.5 * float((rest[signal.used] ** 2).sum())
    return nats


def at_strength(
    ws: Workspace, case: tuple[str, dict[str, object], str, float, str], wanted: float
) -> dict[str, object] | None:
    """Scale the effect of a case to a signal to noise; None where its bounds end before."""
    low, high = 1e-4, 30.0
    try:
        if strength(ws, entry(case, high), case[4]) < wanted:
            return None
        for _ in range(14):
            middle = float(np.sqrt(low * high))
            if strength(ws, entry(case, middle), case[4]) < wanted:
                low = middle
            else:
                high = middle
    except RecipeError:
        return None
    return entry(case, high)


def run_case(
    name: str, effects: Sequence[dict[str, object]], seed: int, withheld: Sequence[str] = ()
) -> tuple[Diagnosis, float, list[np.ndarray]]:
    """Simulate and diagnose recordings; return the true change of the mean, inf where lost."""
    scene, sheet = part(name), datasheet(POINTS)
    made = [
        record(
            scene,
            sheet,
            effects,
            name=f"r{k}",
            seed=seed * 10 + k,
            profiles=PROFILES,
            pitch_mm=PITCH_MM,
            **view,
        )
        for k, view in enumerate(VIEWS)
    ]
    began = time.process_time()
    result = diagnose(made, scene.vertices_mm, scene.faces, sheet, withheld=withheld, seed=seed)
    seconds = time.process_time() - began
    truth = []
    for k, view in enumerate(VIEWS):
        quiet = [
            record(scene, replace(sheet, z_resolution_um=0.0, repeatability_um=0.0), e, name="t",
                   seed=seed * 10 + k, profiles=PROFILES, pitch_mm=PITCH_MM, speckle=None, **view)
            for e in (effects, ())
        ]  # fmt: skip
        change = quiet[0].depth_mm - quiet[1].depth_mm
        change[np.isnan(quiet[0].depth_mm) & np.isfinite(quiet[1].depth_mm)] = np.inf
        truth.append(change)
    return result, seconds, truth


def iou(result: Diagnosis, truth: Sequence[np.ndarray], noise: NoiseModel) -> float | None:
    """Overlap of the located points with those truly moved, beyond the placement, or lost."""
    patches = {p.recording: p for p in (*result.fit_patches, *result.held_patches)}
    wanted = []
    for k, change in enumerate(truth):
        columns = patches[k].columns[..., :RIGID]
        known = np.isfinite(change) & ~patches[k].edge
        ridge = 1e-9 * np.eye(columns.shape[-1])
        some = columns[known]
        found = np.linalg.solve(some.T @ some + ridge, some.T @ change[known])
        left = np.where(np.isfinite(change), change - columns @ found, 0.0)
        lost = np.isinf(change).astype(float)
        wanted.append(departure_mask(left, lost, np.full(change.shape, noise.sd_mm)))
    both = sum(int((w & m.mask).sum()) for w, m in zip(wanted, result.maps, strict=True))
    either = sum(int((w | m.mask).sum()) for w, m in zip(wanted, result.maps, strict=True))
    return both / either if either and any(w.any() for w in wanted) else None


def gain_share(result: Diagnosis, effect: dict[str, object]) -> float | None:
    """Held-out gain as a share of what the true effect gains there; None where that is nothing."""
    true = Model(effects=(effect_of(dict(effect)),))
    best = judge(result.held_patches, result.noise, true, share_own=True).log_score
    plain = judge(result.held_patches, result.noise, Model(), share_own=True).log_score
    if plain - best < 2e-3:
        return None
    return (result.before.log_score - result.after.log_score) / (plain - best)


def main() -> None:
    """Run the bench within its minutes and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/diagnosis-bench.md"))
    parser.add_argument("--nulls", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    began = time.monotonic()
    rows: list[Row] = []

    def late(share: float) -> bool:
        return time.monotonic() - began > 60 * args.minutes * share

    names = ("domes", "steps", "wedge", "bowl")
    spaces: dict[str, Workspace] = {}
    for wanted in (24, 12, 6):
        for case in CASES:
            if late(0.6):
                break
            name = case[4]
            spaces.setdefault(name, bench_workspace(name))
            effect = at_strength(spaces[name], case, wanted)
            if effect is None:
                continue
            result, seconds, truth = run_case(name, [effect], args.seed + 100 * wanted)
            rows.append(_row("one", case, wanted, effect, result, seconds, truth))
            print(rows[-1], flush=True)
    for pair in PAIRS:
        if late(0.7):
            break
        both = [next(c for c in CASES if c[0] == name) for name in pair]
        shown = both[0][4]
        spaces.setdefault(shown, bench_workspace(shown))
        effects = [at_strength(spaces[shown], (*c[:4], shown), 24) for c in both]
        if None in effects:
            continue
        result, seconds, truth = run_case(shown, [e for e in effects if e], args.seed + 9)
        rows += [
            _row("pair", c, 24, e, result, seconds, truth)
            for c, e in zip(both, effects, strict=True)
            if e
        ]
        print(rows[-1], flush=True)
    for name in WITHHELD:
        case = next(c for c in CASES if c[0] == name)
        for wanted in STRENGTHS:
            if late(0.8):
                break
            spaces.setdefault(case[4], bench_workspace(case[4]))
            effect = at_strength(spaces[case[4]], case, wanted)
            if effect is None:
                continue
            result, seconds, truth = run_case(case[4], [effect], args.seed + 7, withheld=(name,))
            rows.append(_row("withheld", case, wanted, effect, result, seconds, truth))
            print(rows[-1], flush=True)
    for k in range(args.nulls):
        if late(1.0):
            break
        result, seconds, _ = run_case(names[k % 4], [], args.seed + 2000 + k)
        rows.append(
            Row(kind="null", effect=names[k % 4], strength=0, verdict=result.verdict,
                found=tuple(e.name for e in result.effects), rivals=(), error=None, gain_share=None,
                iou=None, seconds=seconds)
        )  # fmt: skip
        print(rows[-1], flush=True)
    args.out.write_text(table(rows, args.seed), encoding="utf-8")


def _row(
    kind: str,
    case: tuple[str, dict[str, object], str, float, str],
    wanted: int,
    effect: dict[str, object],
    result: Diagnosis,
    seconds: float,
    truth: Sequence[np.ndarray],
) -> Row:
    names = tuple(e.name for e in result.effects if e.name != "empirical")
    mine = next((e for e in result.effects if e.name == case[0]), None)
    error = None
    true = effect[case[2]]
    if mine is not None and isinstance(true, float) and case[2] in mine.parameters and true:
        error = abs(mine.parameters[case[2]][0] - true) / abs(true)
    return Row(
        kind=kind, effect=case[0], strength=wanted, verdict=result.verdict, found=names,
        rivals=tuple(n for e in result.effects for n, _ in e.alternatives), error=error,
        gain_share=None if kind == "pair" else gain_share(result, effect),
        iou=iou(result, truth, result.noise), seconds=seconds,
    )  # fmt: skip


def table(rows: Sequence[Row], seed: int) -> str:
    """Write the figures as Markdown."""
    nulls = [r for r in rows if r.kind == "null"]
    alarms = sum(r.verdict != "match" for r in nulls)
    high = float(stats.beta.ppf(0.975, alarms + 1, len(nulls) - alarms)) if nulls else 1.0
    low = float(stats.beta.ppf(0.025, alarms, len(nulls) - alarms + 1)) if alarms else 0.0
    lines = [
        "# Development bench of the diagnosis",
        "",
        f"Made by `python -m benchmarks.diagnose`, seed {seed}: two recordings fitted, one held "
        f"out, {PROFILES} x {POINTS} points each, from the plain simulator plus effects. The "
        "effect on the left was in the recordings; what was found stands on the right. Strength "
        "is the whitened signal to noise over the fitted recordings, the pose projected out.",
        "",
        f"- false alarms on nulls: {alarms} of {len(nulls)} (95 %: {100 * low:.1f} to "
        f"{100 * high:.1f} %)",
    ]
    for wanted in STRENGTHS:
        ones = [r for r in rows if r.kind == "one" and r.strength == wanted]
        if not ones:
            continue
        hits = sum(
            1.0 if r.effect in r.found else 0.5 if r.effect in r.rivals else 0.0 for r in ones
        )
        named = sum(len(r.found) for r in ones)
        right = sum(r.effect in r.found for r in ones)
        errors = [r.error for r in ones if r.error is not None]
        overlaps = [r.iou for r in ones if r.iou is not None and r.effect in r.found]
        line = (
            f"- strength {wanted}: recall {hits / len(ones):.2f} ({len(ones)} cases), precision "
            f"{right / named if named else 1.0:.2f}"
        )
        if errors:
            line += f", median parameter error {100 * float(np.median(errors)):.0f} %"
        shares = [r.gain_share for r in ones if r.gain_share is not None and r.effect in r.found]
        if shares:
            line += f", median share of the true law's held-out gain {float(np.median(shares)):.2f}"
        if overlaps:
            line += f", median IoU {float(np.median(overlaps)):.2f}"
        lines.append(line)
    pairs = [r for r in rows if r.kind == "pair"]
    if pairs:
        lines.append(
            f"- pairs at strength 24 each: {sum(r.effect in r.found for r in pairs)} of "
            f"{len(pairs)} effects found"
        )
    unknown = [r for r in rows if r.kind == "withheld"]
    if unknown:
        flagged = sum(r.verdict in ("unexplained", "partly_explained") for r in unknown)
        lines.append(
            f"- effects withheld from the catalogue: {flagged} of {len(unknown)} said to be "
            "unexplained, wholly or in part"
        )
    lines.append(
        f"- median processor time of a case: {float(np.median([r.seconds for r in rows])):.1f} s"
    )
    lines += [
        "",
        "| kind | effect | strength | verdict | found | rivals | parameter error | IoU |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for r in rows:
        if r.kind == "null" and r.verdict == "match":
            continue
        error = "" if r.error is None else f"{100 * r.error:.0f} %"
        overlap = "" if r.iou is None else f"{r.iou:.2f}"
        lines.append(
            f"| {r.kind} | {r.effect} | {r.strength or ''} | {r.verdict} | {', '.join(r.found)} | "
            f"{', '.join(r.rivals)} | {error} | {overlap} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
