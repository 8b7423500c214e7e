"""The whole diagnosis: register, calibrate, detect, explain, judge, locate."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.calibration import calibrated_noise, nominal_noise, nominal_sd_mm
from diagnosis.candidates import candidates_of
from diagnosis.empirical_fit import fit_empirical
from diagnosis.explain import Explanation, explain
from diagnosis.finding import Finding
from diagnosis.finish import averaged_grain, finish_effects, finish_estimates, sunken
from diagnosis.firmware import filtered_instead
from diagnosis.found import FoundEffect, at_limits, found_effects, plainly_found, sheet_with
from diagnosis.heldout import Judgement, judge
from diagnosis.inputs import (
    check_overlap,
    checked,
    lateral_mm,
    repeats,
    tiles,
    with_brightness,
)
from diagnosis.leftover import held_findings
from diagnosis.locate import Region
from diagnosis.maps import RecordingMaps, map_recording
from diagnosis.mounting import LEAST_NATS, mounting_error
from diagnosis.noise import NoiseModel
from diagnosis.patch import Patch, in_range
from diagnosis.recorded import Recorded
from diagnosis.registration import Placement, register
from diagnosis.residual_structure import Residual, residual_structure
from diagnosis.select import LEAST_GAIN, Selection
from diagnosis.shrinkage import shrunk_at_edges
from diagnosis.uncertainty import refined
from diagnosis.workspace import Model, Workspace
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects.form_error import FormError
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.onboard_filter import OnboardFilter
from sensors.recording import Recording
from sensors.surface.surface import Surface
from sensors.typed_yaml import RecipeError

Progress = Callable[[str], None]
STILL_BENT = 0.4
"""Departure of the mean, in units of the noise, that is never passed over as a remainder."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Diagnosis:
    """Everything a report needs."""

    verdict: str
    effects: tuple[FoundEffect, ...]
    left: tuple[Residual, ...]
    found: tuple[Finding, ...]
    regions: tuple[Region, ...]
    share_of_points: float
    before: Judgement
    after: Judgement
    maps: tuple[RecordingMaps, ...]
    datasheet: Datasheet
    model: Model
    noise: NoiseModel
    threshold: float
    fitted: tuple[str, ...]
    held: tuple[str, ...]
    held_patches: tuple[Patch, ...]
    fit_patches: tuple[Patch, ...]
    notes: tuple[str, ...]
    seed: int


def diagnose(
    recordings: Sequence[Recording],
    vertices_mm: NDArray[np.float64],
    faces: NDArray[np.int32],
    datasheet: Datasheet,
    *,
    surface: Surface | None = None,
    references: Sequence[Recording] = (),
    holdout: Sequence[Recording] = (),
    seed: int = 0,
    withheld: Iterable[str] = (),
    progress: Progress = lambda text: None,
) -> Diagnosis:
    """Diagnose recordings of one part by one sensor.

    Parameters
    ----------
    recordings : to fit on; without `holdout`, the last of several is held out, or blocks of one
    vertices_mm, faces : the part's closed mesh, part frame
    surface : nominal roughness, if any is claimed
    references : scans of a flat plate by the same instrument
    withheld : names of effects that must not be considered

    Raises
    ------
    RecipeError
        Where the input can't be used.
    """
    if not recordings:
        raise RecipeError("no recording to diagnose")
    withheld = frozenset(withheld)
    scene = Scene(vertices_mm, faces)
    rng = np.random.default_rng(seed)
    notes: list[str] = []
    fit_on, held = list(recordings), list(holdout)
    if not held and len(fit_on) > 1:
        held = [fit_on.pop()]
    single = not held
    everything = [*fit_on, *held]
    inputs = checked(everything, references, scene, datasheet, surface, notes)
    laser, surface = inputs.laser, inputs.surface

    placed = _registered(everything, scene, datasheet, laser, progress)
    scene, everything = with_brightness(everything, placed, scene, datasheet, laser)
    recorded = Recorded(
        recordings=tuple(everything), scene=scene, datasheet=datasheet, laser=laser,
        lateral_mm=lateral_mm(everything[0]),
        held_out=tuple(
            tiles(*r.depth_mm.shape) if single else np.full(r.depth_mm.shape, k >= len(fit_on))
            for k, r in enumerate(everything)
        ),
    )  # fmt: skip
    patches = [p for k, r in enumerate(everything) for p in recorded.cut(k, placed[r.name])]
    check_overlap(patches)
    progress("calibrating the noise")
    noise, nominal = calibrated_noise(patches, inputs.plates, notes)
    repeated = repeats(everything, notes)
    explanation = explain(
        patches, noise, recorded, placed, rng, withheld=withheld, share_own=not single,
        notes=notes, progress=progress,
    )  # fmt: skip
    selection, model, ws = explanation.selection, explanation.model, explanation.ws
    held_patches = explanation.held
    last = held_findings(
        selection.last.significant(), held_patches, ws, model, least_gain=LEAST_GAIN, rng=rng
    )
    verdict, left = _verdict(selection, last)
    bent = any(f.channel == "mean" and f.size > STILL_BENT for f in left)
    beside, strange, plain_noise = _finished(
        explanation, noise, nominal, surface, bent=bent, withheld=withheld, share_own=not single
    )
    if plain_noise is not noise and nominal is not None:
        model = sunken(ws, model, [f.effect for f in beside], withheld)
    warped = any(isinstance(e, FormError) and e.coefficients_um for e in model.effects)
    if "pose_error" not in withheld and not warped:
        # what the model takes for physics is no misplacement; a warped part's low waves turn and
        # shift it, so that how it lies can't be told from how the sensor sits
        beside += _mounted(ws, model, everything, explanation.placed, held_patches)
    verdict, left = _joined(verdict, left, bool(beside), [*repeated, *strange])
    described = residual_structure(left, ws, model)
    if verdict in ("unexplained", "partly_explained"):
        progress("describing what is left")
        empirical = fit_empirical(ws, model, left)
        if empirical is not None:
            model = model.with_effect(empirical)
    model = refined(ws, model)
    progress("judging on held-out readings")
    candidates = candidates_of(
        recorded, placed, explanation.placed, (patches, explanation.patches), model, noise,
        share_own=not single,
    )  # fmt: skip
    nominally = candidates.placed(Model())
    before = judge(nominally.held, plain_noise, Model(), share_own=not single)
    found, after = found_effects(ws, model, selection.choices, candidates)
    if any(f.name == "empirical" and f.heldout_gain < LEAST_GAIN for f in found):
        model = model.without("empirical")
        found, after = found_effects(ws, model, selection.choices, candidates)
    found, beside = averaged_grain(found, beside, withheld)
    found = tuple(sorted([*found, *beside], key=lambda f: -f.heldout_gain))
    notes += at_limits(found)
    progress("drawing maps")
    finally_placed = candidates.placed(shrunk_at_edges(ws, model))
    # a mismatch is held against the noise of an instrument without it
    usual = 1.0 if nominal is None else nominal.sd_mm / noise.sd_mm
    for blur in _blurs(model):
        usual = max(usual, 1 / blur.quieter(ws.patches[0].view))
    maps = [
        map_recording(recorded, k, nominally, finally_placed, noise, usual=usual)
        for k in range(len(everything))
    ]
    if verdict == "match":
        maps = [m.silenced() for m in maps]
    elif beside:
        maps = [m.everywhere(beside[-1].name) if not m.mask.any() else m for m in maps]
    regions = tuple(region for m in maps for region in m.regions)
    counted = sum(m.mask.size for m in maps)
    return Diagnosis(
        verdict=verdict,
        effects=found,
        left=described,
        found=tuple(selection.first.significant()),
        regions=regions,
        share_of_points=float(sum(m.mask.sum() for m in maps)) / max(counted, 1),
        before=before,
        after=after,
        maps=tuple(maps),
        datasheet=sheet_with(datasheet, [f.effect.shared() for f in found]),
        model=model,
        noise=noise,
        threshold=selection.first.threshold,
        fitted=tuple(r.name for r in fit_on),
        held=tuple(r.name for r in held),
        held_patches=tuple(nominally.held),
        fit_patches=ws.patches,
        notes=tuple(notes),
        seed=seed,
    )


def _registered(
    recordings: Sequence[Recording],
    scene: Scene,
    datasheet: Datasheet,
    laser: Mapping[str, Laser],
    progress: Progress,
) -> dict[str, Placement]:
    """Register each recording under the nominal model; placements by name."""
    placed: dict[str, Placement] = {}
    for recording in recordings:
        progress(f"registering {recording.name}")
        valid = np.isfinite(in_range(recording.depth_mm, datasheet))
        placed[recording.name] = register(
            scene, recording, laser[recording.name], datasheet=datasheet, valid=valid,
            sd_mm=datasheet.step_mm / 2,
        )  # fmt: skip
    return placed


def _finished(
    explanation: Explanation,
    noise: NoiseModel,
    nominal: NoiseModel | None,
    surface: Surface | None,
    *,
    bent: bool,
    withheld: Collection[str],
    share_own: bool,
) -> tuple[list[FoundEffect], list[Finding], NoiseModel]:
    """Compare the noise with what plates or the surface's file claim.

    Returns
    -------
    effects on the surface's texture; findings that none of them explains; the nominal noise
    """
    model, ws = explanation.model, explanation.ws
    view = ws.patches[0].view
    claimed = nominal_sd_mm(nominal, surface, view)
    effects, findings = finish_effects(ws, model, noise, nominal, claimed, bent=bent)
    if surface is not None and nominal is None and OnboardFilter.name not in withheld:
        effects = filtered_instead(effects, noise, surface, view)
    effects = [e for e in effects if e.name not in withheld]
    if not effects:
        return [], findings, noise
    plain_noise = nominal_noise(noise, nominal, surface, view)
    plain, level, whole = (
        judge(explanation.held, n, model, share_own=share_own).log_score
        for n in (plain_noise, replace(plain_noise, sd_mm=noise.sd_mm), noise)
    )
    # what has a lay has it at its level: the level alone is the lesser explanation
    gains = {e.name: plain - whole for e in effects}
    if len(effects) > 1:
        gains["roughness_level"] = min(plain - level, plain - whole)
    found = [
        plainly_found(e, gains[e.name], finish_estimates(e))
        for e in effects
        if gains[e.name] >= LEAST_GAIN
    ]
    return found, [], plain_noise


def _mounted(
    ws: Workspace,
    model: Model,
    recordings: Sequence[Recording],
    placed: Mapping[str, Placement],
    held: Sequence[Patch],
) -> list[FoundEffect]:
    """Return what the fitted recordings share of the mounting if the held-out ones bear it out."""
    moved = ws.placements(model)
    fitted = [placed[recordings[k].name].further(moved[k]) for k in moved]
    mounting = mounting_error(
        [recordings[k].poses for k in moved], fitted, travel_mm=_travelled_mm(ws, model)
    )
    if mounting is None:
        return []
    apart = Workspace.build(held, ws.noise)
    moved = apart.placements(model, [p.counted & ~p.edge for p in held])
    gain = sum(
        mounting.gain(recordings[k].poses, placed[recordings[k].name].further(step))
        for k, step in moved.items()
    )
    if gain < LEAST_NATS:
        return []
    per_reading = gain / max(sum(int(p.counted.sum()) for p in held), 1)
    return [plainly_found(mounting.effect, per_reading, mounting.intervals)]


def _travelled_mm(ws: Workspace, model: Model) -> float:
    """Half of the longest way during an exposure: where in it a pose is stated isn't known."""
    ways = [blur.longest_way_mm(p.view) for blur in _blurs(model) for p in ws.patches]
    return 0.5 * float(max(ways, default=0.0))


def _blurs(model: Model) -> list[MotionBlur]:
    return [e for e in model.effects if isinstance(e, MotionBlur)]


def _verdict(selection: Selection, last: list[Finding]) -> tuple[str, list[Finding]]:
    """Judge what the findings that are left after the explanation amount to."""
    if not selection.choices:
        return ("unexplained" if last else "match"), last
    explained = sum(c.gain for c in selection.choices)
    rest = max((f.gain for f in last), default=0.0)
    bent = any(f.channel == "mean" and f.size > STILL_BENT for f in last)
    if not last or (rest < 0.05 * explained and not bent):
        return "explained", []
    if rest > 2 * explained:
        return "unexplained", last
    return "partly_explained", last


def _joined(
    verdict: str, left: list[Finding], known: bool, more: list[Finding]
) -> tuple[str, list[Finding]]:
    """Join a verdict with what was found beside the selection, known by name or left over."""
    if known:
        verdict = {"match": "explained", "unexplained": "partly_explained"}.get(verdict, verdict)
    if more:
        verdict = {"match": "unexplained", "explained": "partly_explained"}.get(verdict, verdict)
    return verdict, [*left, *more]
