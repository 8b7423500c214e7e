"""The development bench of the diagnosis: nulls, every effect at three strengths, withheld effects.

Recordings come from the nominal simulator plus effects, so that this shows errors of the inference,
not of the physics. strength.py says what a strength is.

    python -m benchmarks.diagnose [--nulls 60] [--minutes 30]
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import stats

from benchmarks.strength import at_strength
from diagnosis.diagnose import diagnose
from diagnosis.diagnosis import Diagnosis
from diagnosis.localise.maps import RIGID
from diagnosis.localise.regions import departure_mask
from diagnosis.model.model import Model
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.prepare import Inputs
from diagnosis.validate.heldout import judge
from sensors.effects import effect_of
from sensors.surface.reflectance import ReflectanceMap, Stripes
from tests.support.effect_case import POINTS, PROFILES, Case, Entry, plain
from tests.support.small_parts import VIEWS

STRENGTHS = (6, 12, 24)
TURNED = tuple({**view, "heading_deg": 60.0 * k} for k, view in enumerate((*VIEWS, *VIEWS)))
"""Six orientations: a mounting shows where a sensor's errors agree in its own frame."""
SLOW = {"profile_rate_hz": 0.5, "travel_speed_mm_s": 0.3}
"""A recording of minutes, in which an instrument warms up."""
NO_STRENGTH = frozenset({"axis_quantisation", "onboard_filter", "row_repeat"})
"""Effects of the firmware, which replaces readings: no strength is defined for them. The diagnosis
measures them by claims of their own (`diagnosis/claims/`)."""

CASES = (
    Case(name="line_bow", scaled="sag_um", part="domes"),
    Case(name="lens_distortion", scaled="cubic_um", part="domes", more={"tilt_um": 0.0}),
    Case(name="lateral_error", scaled="scale_um", part="domes", more={"shear_um": 0.0}),
    Case(name="range_scale", scaled="error_ppm", part="bowl"),
    Case(name="incidence_bias", scaled="squared_um", part="domes", more={"signed_um": 0.0}),
    Case(name="volume_scattering", scaled="depth_um", part="domes"),
    Case(name="stage_vibration", scaled="amplitude_um", part="wedge",
         more={"frequency_hz": 23.0}),
    Case(name="travel_ripple", scaled="amplitude_um", part="domes", more={"period_mm": 6.0}),
    Case(name="pixel_locking", scaled="amplitude_px", part="bowl"),
    Case(name="column_offset", scaled="rms_um", part="bowl", more={"seed": 5}),
    Case(name="form_error", scaled="coefficients_um", part="wedge"),
    Case(name="finite_spot", scaled="line_sd_um", part="steps"),
    Case(name="edge_mixing", scaled="line_sd_um", part="steps"),
    Case(name="interreflection", scaled="weight", part="valley", more={"reach_mm": 5.0}),
    Case(name="motion_blur", scaled="exposure_ms", part="steps"),
    Case(name="incidence_noise", scaled="exponent", part="wedge"),
    Case(name="camera_occlusion", scaled="triangulation_angle_deg", part="steps"),
    Case(name="specular_dropout", scaled="share", part="domes"),
    Case(name="light_falloff", scaled="share", part="domes",
         more={"ends": 0.3, "noise_exponent": 0.0}),
    Case(name="random_dropout", scaled="share", part="wedge"),
    Case(name="outlier_spikes", scaled="share", part="bowl", more={"width_um": 300.0}),
    Case(name="reflectance_edge", scaled="line_sd_um", part="domes",
         reflectance=ReflectanceMap(base=0.9, stripes=(Stripes(value=0.3, period_mm=8.0),))),
    Case(name="thermal_drift", scaled="amplitude_um", part="domes", sheet=SLOW,
         more={"time_constant_s": 100.0}, starts_s=(0.0, 200.0, 400.0)),
    Case(name="pose_error", scaled="pitch_deg", part="domes", views=TURNED,
         more={"roll_deg": 0.0, "yaw_deg": 0.0}),
    Case(name="anisotropic_lay", scaled="ratio", part="wedge", more={"angle_deg": 30.0},
         plates=True),
    Case(name="roughness_level", scaled="amplitude", part="wedge", plates=True),
)  # fmt: skip
OF = {case.name: case for case in CASES}
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


def run_case(
    case: Case, effects: Sequence[Entry], seed: int, withheld: Sequence[str] = ()
) -> tuple[Diagnosis, float, list[np.ndarray]]:
    """Simulate and diagnose recordings; return the true change of the mean, inf where lost."""
    scene, sheet = case.scene(), case.datasheet()
    numbers = range(len(case.views))
    made = [case.record(effects, k, name=f"r{k}", seed=seed * 10 + k) for k in numbers]
    plates = case.references(seed * 10)
    began = time.process_time()
    inputs = Inputs(
        recordings=made, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=sheet,
        references=plates,
    )  # fmt: skip
    result = diagnose(inputs, withheld=withheld, seed=seed)
    seconds = time.process_time() - began
    exact = replace(sheet, z_resolution_um=0.0, repeatability_um=0.0)
    truth = []
    for k in numbers:
        with_it, without = (
            case.record(e, k, name="t", seed=seed * 10 + k, sheet=exact, speckle=None).depth_mm
            for e in (effects, ())
        )
        change = with_it - without
        change[np.isnan(with_it) & np.isfinite(without)] = np.inf
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


def gain_share(result: Diagnosis, effect: Entry) -> float | None:
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
    parser.add_argument("--out", type=Path, default=Path("docs/diagnosis-bench-catalogue.md"))
    parser.add_argument("--nulls", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    began = time.monotonic()
    rows: list[Row] = []

    def late(share: float) -> bool:
        return time.monotonic() - began > 60 * args.minutes * share

    for wanted in (24, 12, 6):
        for case in CASES:
            if late(0.6):
                break
            effect = at_strength(case, wanted)
            if effect is None:
                print(f"{case.name}: no strength of {wanted} within its bounds", flush=True)
                continue
            result, seconds, truth = run_case(case, [effect], args.seed + 100 * wanted)
            rows.append(_row("one", case, wanted, effect, result, seconds, truth))
            print(rows[-1], flush=True)
    for pair in PAIRS:
        if late(0.7):
            break
        both = [OF[name].on(OF[pair[0]].part) for name in pair]
        effects = [at_strength(case, 24) for case in both]
        if None in effects:
            continue
        result, seconds, truth = run_case(both[0], [e for e in effects if e], args.seed + 9)
        rows += [
            _row("pair", c, 24, e, result, seconds, truth)
            for c, e in zip(both, effects, strict=True)
            if e
        ]
        print(rows[-1], flush=True)
    for name in WITHHELD:
        case = OF[name]
        for wanted in STRENGTHS:
            if late(0.8):
                break
            effect = at_strength(case, wanted)
            if effect is None:
                continue
            result, seconds, truth = run_case(case, [effect], args.seed + 7, withheld=(name,))
            rows.append(_row("withheld", case, wanted, effect, result, seconds, truth))
            print(rows[-1], flush=True)
    nothing = [plain(name) for name in ("domes", "steps", "wedge", "bowl")]
    for k in range(args.nulls):
        if late(1.0):
            break
        case = nothing[k % len(nothing)]
        result, seconds, _ = run_case(case, [], args.seed + 2000 + k)
        rows.append(
            Row(kind="null", effect=case.part, strength=0, verdict=result.verdict,
                found=tuple(e.name for e in result.effects), rivals=(), error=None, gain_share=None,
                iou=None, seconds=seconds)
        )  # fmt: skip
        print(rows[-1], flush=True)
    args.out.write_text(table(rows, args.seed), encoding="utf-8")


def _row(
    kind: str,
    case: Case,
    wanted: int,
    effect: Entry,
    result: Diagnosis,
    seconds: float,
    truth: Sequence[np.ndarray],
) -> Row:
    names = tuple(e.name for e in result.effects if e.name != "empirical")
    mine = next((e for e in result.effects if e.name == case.name), None)
    error = None
    true = effect[case.scaled]
    if mine is not None and isinstance(true, float) and case.scaled in mine.parameters and true:
        error = abs(mine.parameters[case.scaled].value - true) / abs(true)
    return Row(
        kind=kind, effect=case.name, strength=wanted, verdict=result.verdict, found=names,
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
        f"out, {PROFILES} x {POINTS} points each, from the nominal simulator plus effects. The "
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
