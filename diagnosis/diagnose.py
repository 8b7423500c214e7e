"""The whole diagnosis: register, calibrate, detect, explain, judge, locate."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.calibration import nominal_noise, nominal_sd_mm
from diagnosis.candidates import Candidates, Placed, candidates_of
from diagnosis.cause import Cause
from diagnosis.delivery import delivered
from diagnosis.evidence.next_scan import NextScan, next_scans
from diagnosis.evidence.population import population
from diagnosis.explain import Explanation, explain
from diagnosis.finish import averaged_grain, finish_effects, finish_estimates, sunken
from diagnosis.firmware import filtered_instead
from diagnosis.found import (
    FoundEffect,
    at_limits,
    found_effects,
    plainly_found,
    probability,
    sheet_with,
)
from diagnosis.heldout import Judgement, judge
from diagnosis.locate import Region
from diagnosis.maps import RecordingMaps, map_recording
from diagnosis.mounting import LEAST_NATS, mounting_error
from diagnosis.noise import NoiseModel
from diagnosis.patch import Patch
from diagnosis.prepare import Inputs, Prepared, prepared
from diagnosis.registration import Placement
from diagnosis.residual_structure import Residual, residual_structure
from diagnosis.settings import SETTINGS
from diagnosis.shrinkage import shrunk_at_edges
from diagnosis.uncertainty import refined
from diagnosis.workspace import Model, Workspace
from sensors.datasheet import Datasheet
from sensors.effects.form_error import FormError
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.onboard_filter import OnboardFilter
from sensors.recording import Recording
from sensors.surface.surface import Surface

Progress = Callable[[str], None]

@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Diagnosis:
    """Everything a report needs."""

    verdict: str
    effects: tuple[FoundEffect, ...]
    left: tuple[Residual, ...]
    none_of_these: float
    next_measurements: tuple[NextScan, ...]
    population: str
    assumed: Mapping[str, object]
    regions: tuple[Region, ...]
    share_of_points: float
    before: Judgement
    after: Judgement
    maps: tuple[RecordingMaps, ...]
    datasheet: Datasheet
    model: Model
    noise: NoiseModel
    fitted: tuple[str, ...]
    held: tuple[str, ...]
    baselines: tuple[str, ...]
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
    baselines: Sequence[Recording] = (),
    seed: int = 0,
    withheld: Iterable[str] = (),
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Diagnose recordings of one part by one sensor.

    Parameters
    ----------
    recordings : to fit on; without `holdout`, the last of several is held out, or blocks of one
    vertices_mm, faces : the part's closed mesh, part frame
    surface : nominal roughness, if any is claimed
    references : scans of a flat plate by the same instrument
    baselines : recordings of the part by the same instrument when it was known to be good
    withheld : names of effects that must not be considered

    Raises
    ------
    RecipeError
        Where the input can't be used.
    """
    withheld = frozenset(withheld)
    notes: list[str] = []
    ready = prepared(
        Inputs(
            recordings=recordings, vertices_mm=vertices_mm, faces=faces, datasheet=datasheet,
            surface=surface, references=references, holdout=holdout, baselines=baselines,
        ),
        notes, progress,
    )  # fmt: skip
    by_form = delivered(ready.recorded.recordings, datasheet, notes)
    explanation = explain(
        ready.patches, ready.noise, ready.recorded, ready.placed, population(),
        baseline=ready.baseline, withheld=withheld, notes=notes, progress=progress,
    )  # fmt: skip
    beside = _beside(ready, explanation, withheld)
    formed = [f for f in by_form if f.name not in withheld]
    beside = replace(beside, effects=(*beside.effects, *formed))
    progress("judging on held-out readings")
    judged = _judged(ready, explanation, beside, withheld, notes)
    progress("asking what to measure next")
    measure = next_scans(
        explanation.members, explanation.first, ready.recorded, ready.placed, ready.noise
    )  # fmt: skip
    progress("drawing maps")
    verdict = _verdict(bool(explanation.causes or beside.effects), bool(explanation.strange))
    maps = _drawn(ready, explanation, judged, verdict)
    counted = sum(m.mask.size for m in maps)
    assumed = explanation.recorded.datasheet
    return Diagnosis(
        verdict=verdict,
        effects=judged.effects,
        left=judged.left,
        next_measurements=measure,
        none_of_these=_none_of_these(judged.causes, judged.beside),
        population=population().name,
        assumed={
            key: getattr(assumed, key)
            for key in ("triangulation_angle_deg", "camera_side")
            if getattr(assumed, key) != getattr(datasheet, key)
        },
        regions=tuple(region for m in maps for region in m.regions),
        share_of_points=float(sum(m.mask.sum() for m in maps)) / max(counted, 1),
        before=judged.before,
        after=judged.after,
        maps=maps,
        datasheet=sheet_with(assumed, [f.effect.shared() for f in judged.effects]),
        model=judged.model,
        noise=ready.noise,
        fitted=ready.fitted,
        held=ready.held,
        baselines=tuple(r.name for r in baselines),
        held_patches=tuple(judged.nominally.held),
        fit_patches=explanation.ws.patches,
        notes=tuple(notes),
        seed=seed,
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Beside:
    """What was found beside the causes of the evidence: finish, mounting, delivery.

    Attributes
    ----------
    noise : as the plain model has it
    model : with what averages speckle
    """

    effects: tuple[FoundEffect, ...]
    noise: NoiseModel
    model: Model


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Judged:
    """Causes and their laws as the held-out readings bear on them.

    Attributes
    ----------
    effects : all that are reported, of most use first
    beside : those of them that no law of a reading's mean holds
    nominally : placements under the nominal model
    """

    model: Model
    causes: tuple[Cause, ...]
    effects: tuple[FoundEffect, ...]
    beside: tuple[FoundEffect, ...]
    left: tuple[Residual, ...]
    candidates: Candidates
    nominally: Placed
    before: Judgement
    after: Judgement


def _beside(ready: Prepared, explanation: Explanation, withheld: frozenset[str]) -> _Beside:
    """Compare the noise with its nominal, and the placements with each other."""
    model, ws = explanation.model, explanation.ws
    # what a law of light leaves of the mean passes for noise that isn't the same throughout
    light = any(c.component is not None and c.component.relaxed.spanned for c in explanation.causes)
    bent = any(
        s.channel == "mean" or (light and s.channel == "scale") for s in explanation.strange
    )
    effects, noise = _finished(ready, explanation, bent=bent, withheld=withheld)
    if noise is not ready.noise and ready.nominal is not None:
        model = sunken(ws, model, [f.effect for f in effects], withheld)
    warped = any(isinstance(e, FormError) and e.coefficients_um for e in model.effects)
    if "pose_error" not in withheld and not warped:
        # what the model takes for physics is no misplacement; a warped part's low waves turn and
        # shift it, so that how it lies can't be told from how the sensor sits
        effects += _mounted(
            ws, model, ready.recorded.recordings, explanation.placed, explanation.held
        )
    return _Beside(effects=tuple(effects), noise=noise, model=model)


def _judged(
    ready: Prepared,
    explanation: Explanation,
    beside: _Beside,
    withheld: frozenset[str],
    notes: list[str],
) -> _Judged:
    """Judge the laws on held-out readings; drop those of no use beside others that are."""
    ws, causes = explanation.ws, list(explanation.causes)
    left = residual_structure(explanation.strange, ws, beside.model)
    model = refined(ws, beside.model)
    candidates = candidates_of(
        explanation.recorded, ready.placed, explanation.placed,
        (ready.patches, explanation.patches), model, ready.noise, share_own=not ready.single,
    )  # fmt: skip
    nominally = candidates.placed(Model())
    before = judge(nominally.held, beside.noise, Model(), share_own=not ready.single)
    found, after = found_effects(ws, model, causes, candidates)
    idle = {f.name for f in found if f.heldout_gain < 0}
    if idle and len(idle) < len(found):
        # what is of no use on held-out readings beside a law that is, is that one's remainder
        notes.append(f"{', '.join(sorted(idle))}: fitted, but of no use on held-out readings")
        causes = [c for c in causes if c.name not in idle]
        for name in idle:
            model = model.without(name)
        model = refined(ws, model)
        found, after = found_effects(ws, model, causes, candidates)
    found, others = averaged_grain(found, beside.effects, withheld)
    every = tuple(sorted([*found, *others], key=lambda f: -f.heldout_gain))
    notes += at_limits(every)
    return _Judged(
        model=model, causes=tuple(causes), effects=every, beside=tuple(others), left=left,
        candidates=candidates, nominally=nominally, before=before, after=after,
    )  # fmt: skip


def _drawn(
    ready: Prepared, explanation: Explanation, judged: _Judged, verdict: str
) -> tuple[RecordingMaps, ...]:
    """Draw each recording's maps."""
    ws, model = explanation.ws, judged.model
    finally_placed = judged.candidates.placed(shrunk_at_edges(ws, model))
    # a mismatch is held against the noise of an instrument without it
    usual = 1.0 if ready.nominal is None else ready.nominal.sd_mm / ready.noise.sd_mm
    for blur in _blurs(model):
        usual = max(usual, 1 / blur.quieter(ws.patches[0].view))
    maps = [
        map_recording(
            explanation.recorded, k, judged.nominally, finally_placed, ready.noise, usual=usual
        )
        for k in range(len(ready.recorded.recordings))
    ]
    if verdict == "match":
        maps = [m.silenced() for m in maps]
    elif judged.beside:
        maps = [m if m.mask.any() else m.everywhere(judged.beside[-1].name) for m in maps]
    return tuple(maps)


def _finished(
    ready: Prepared, explanation: Explanation, *, bent: bool, withheld: Collection[str]
) -> tuple[list[FoundEffect], NoiseModel]:
    """Compare the noise with what plates, baselines or the surface's file claim.

    Returns
    -------
    effects on the surface's texture; the nominal noise
    """
    model, ws, share_own = explanation.model, explanation.ws, not ready.single
    noise, nominal, surface = ready.noise, ready.nominal, ready.surface
    view = ws.patches[0].view
    claimed = nominal_sd_mm(nominal, surface, view)
    effects = finish_effects(ws, model, noise, nominal, claimed, explanation.scales, bent=bent)
    if surface is not None and nominal is None and OnboardFilter.name not in withheld:
        effects = filtered_instead(effects, noise, surface, view)
    effects = [e for e in effects if e.name not in withheld]
    if not effects:
        return [], noise
    plain_noise = nominal_noise(noise, nominal, surface, view)
    plain, level, whole = (
        judge(explanation.held, n, model, share_own=share_own).log_score
        for n in (plain_noise, replace(plain_noise, sd_mm=noise.sd_mm), noise)
    )
    # what has a lay has it at its level: the level alone is the lesser explanation
    gains = {e.name: plain - whole for e in effects}
    if len(effects) > 1:
        gains["roughness_level"] = min(plain - level, plain - whole)
    readings = sum(int(p.scored.sum()) for p in explanation.held)
    found = [
        plainly_found(
            e, gains[e.name], finish_estimates(e),
            probability=probability(readings * gains[e.name], e.name),
        )
        for e in effects
        if readings * gains[e.name] + SETTINGS.log_odds(e.name) > 0
    ]  # fmt: skip
    return found, plain_noise


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
    return [
        plainly_found(
            mounting.effect, per_reading, mounting.intervals,
            probability=1.0 - np.exp(-gain),
        )
    ]  # fmt: skip


def _travelled_mm(ws: Workspace, model: Model) -> float:
    """Half of the longest way during an exposure: where in it a pose is stated isn't known."""
    ways = [blur.longest_way_mm(p.view) for blur in _blurs(model) for p in ws.patches]
    return 0.5 * float(max(ways, default=0.0))


def _blurs(model: Model) -> list[MotionBlur]:
    return [e for e in model.effects if isinstance(e, MotionBlur)]


def _verdict(named: bool, strange: bool) -> str:
    """Sum up: whether causes were named, and whether something is left that none explains."""
    if named:
        return "partly_explained" if strange else "explained"
    return "unexplained" if strange else "match"


def _none_of_these(causes: Sequence[Cause], beside: Sequence[FoundEffect]) -> float:
    """Probability that none of the names given holds, or that what departs has no name at all."""
    if not causes and not beside:
        return 1.0
    missed = 1.0
    for held in [1 - c.none_of_these for c in causes] + [f.probability for f in beside]:
        missed *= 1 - held
    return float(max(missed, 0.0))
