"""The whole diagnosis: register, calibrate, detect, explain, judge, locate."""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logit

from diagnosis.beside_unknown import doubted_causes, doubted_claims
from diagnosis.claims.firmware import filtered_readings, otherwise_explained
from diagnosis.claims.mounting import blurs, mounted
from diagnosis.claims.repeats_and_steps import delivered
from diagnosis.claims.stuck_bit import stuck_bit
from diagnosis.claims.surface_texture import Left, texture
from diagnosis.claims.translucency import averaged_grain, sunken
from diagnosis.diagnosis import Diagnosis
from diagnosis.discrepancy.population import population
from diagnosis.evidence.next_scan import next_scans
from diagnosis.evidence.reported_causes import Cause, Unexplained, unnamed
from diagnosis.explained_again import explained_again
from diagnosis.explanation import Explanation, Progress
from diagnosis.localise.maps import RecordingMaps, map_recording
from diagnosis.localise.residual_structure import described, residual_structure
from diagnosis.model.model import Model
from diagnosis.model.shrinkage import shrunk
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.uncertainty import refined
from diagnosis.prepare import Inputs, Prepared, prepared
from diagnosis.refuted import LAW_REFUTED, with_free_curves, without_names
from diagnosis.validate.found_effects import FoundEffect, at_limits, found_effects, sheet_with
from diagnosis.validate.heldout import Judgement, judge
from diagnosis.validate.placement_candidates import Candidates, Placed, candidates_of
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE
from sensors.effects.axis_quantisation import AxisQuantisation
from sensors.effects.base import MotionEffect
from sensors.effects.form_error import FormError
from sensors.effects.row_repeat import RowRepeat


def diagnose(
    inputs: Inputs,
    *,
    seed: int = 0,
    withheld: Iterable[str] = (),
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Diagnose recordings of one part by one sensor.

    Parameters
    ----------
    seed : of the bootstrap intervals of held-out scores
    withheld : names of effects that must not be considered

    Raises
    ------
    RecipeError
        Where the input can't be used.
    """
    withheld = frozenset(withheld)
    notes: list[str] = []
    ready = prepared(inputs, notes, progress)
    known = population().of_files(inputs.datasheet.columns)
    by_form = delivered(
        ready.recorded.recordings, inputs.datasheet, notes, inputs.baselines,
        noise_mm=ready.noise.sd_mm, known=known,
    )  # fmt: skip
    for coarse in (f.effect for f in by_form if isinstance(f.effect, AxisQuantisation)):
        ready = ready.in_steps(1e-3 * coarse.step_um)
    ready, filters = filtered_readings(ready, known, withheld)
    by_form += filters
    stuck = stuck_bit(ready.patches, ready.noise)
    if stuck is not None:
        # the noise is folded and the mean a saw: what goes with them has no other cause
        withheld |= CATALOGUE.keys()
    ready, explanation = explained_again(
        ready, known, withheld, notes, progress, by_all=not inputs.holdout
    )
    ready, by_form = otherwise_explained(ready, explanation.causes, by_form, notes)
    if stuck is not None:
        explanation = replace(explanation, unexplained=(stuck, *explanation.unexplained))
    explanation = doubted_causes(explanation, ready, notes)
    progress("judging on held-out readings")
    explanation, judged, against_claims = _standing(ready, explanation, withheld, notes)
    left = (*explanation.unexplained, *judged.left)
    against_claims = doubted_claims(against_claims, left, ready.filtered)
    # what is told by its form is so: no other mechanism repeats rows, or counts in steps
    against_claims += [f for f in by_form if f.name not in withheld]
    verdict = _verdict(bool(explanation.causes or against_claims), bool(left))
    found, against_claims = averaged_grain(judged.found, against_claims, withheld)
    found = tuple(sorted([*found, *against_claims], key=lambda f: -f.heldout_gain))
    notes += at_limits(found)
    progress("asking what to measure next")
    measure = next_scans(
        explanation.members, explanation.first, ready.recorded, ready.placed, ready.noise
    )
    progress("drawing maps")
    maps = _maps(ready, explanation, judged, verdict, against_claims)
    sheet = explanation.recorded.datasheet
    return Diagnosis(
        verdict=verdict,
        effects=found,
        left=residual_structure(left, explanation.ws, judged.model),
        usual=described(explanation.usual, explanation.ws),
        next_measurements=measure,
        none_of_these=_none_of_these(judged.causes, against_claims),
        population=known.name,
        assumed=assumed(sheet, inputs.datasheet),
        regions=tuple(region for m in maps for region in m.regions),
        share_of_points=float(np.mean(np.concatenate([m.mask.ravel() for m in maps]))),
        before=judged.before,
        after=judged.after,
        maps=tuple(maps),
        datasheet=sheet_with(sheet, [f.effect.shared() for f in found]),
        model=judged.model,
        noise=ready.noise,
        fitted=ready.fitted,
        held=ready.held,
        baselines=tuple(r.name for r in inputs.baselines),
        held_patches=tuple(judged.nominal.held),
        fit_patches=explanation.ws.patches,
        notes=tuple(notes),
        seed=seed,
    )


def _standing(
    ready: Prepared, explanation: Explanation, withheld: Collection[str], notes: list[str]
) -> tuple[Explanation, "_Judged", list[FoundEffect]]:
    """Judge an explanation; what held-out readings refute is taken back and judged again.

    Returns
    -------
    the explanation that stands, its model as judged, and the effects found against claims
    """
    model, against_claims, plain_noise = _against_claims(ready, explanation, withheld)
    model = refined(explanation.ws, model)
    judged = judge_on_heldout(ready, explanation, model, plain_noise, notes)
    for instead, why in ((with_free_curves, LAWS_REFUTED), (without_names, CURVES_REFUTED)):
        if not _refuted(explanation, judged):
            break
        notes.append(why)
        explanation = instead(explanation, ready)
        model, against_claims, plain_noise = _against_claims(ready, explanation, withheld)
        judged = judge_on_heldout(ready, explanation, model, plain_noise, notes)
    return explanation, judged, against_claims


LAWS_REFUTED = "held-out readings refute the laws found: free curves take their place"
CURVES_REFUTED = "held-out readings refute the curves, too: none of their causes is named"


def _refuted(explanation: Explanation, judged: "_Judged") -> bool:
    """Whether held-out readings say more against the laws than fitted ones say for them.

    Or whether, of several laws, those that weren't dropped as of no use are of none either.
    """
    if not explanation.causes:
        return False
    if len(judged.found) < len(explanation.causes) and all(
        f.heldout_gain < 0 for f in judged.found
    ):
        return True
    worse = judged.after.log_score - judged.bare.log_score
    readings = sum(int(p.scored.sum()) for p in judged.nominal.held)
    for_laws = gained(explanation.ws, explanation.model, Model())
    return outweighed(for_laws, readings * worse, explanation.causes)


def outweighed(gain: float, lost: float, causes: Sequence[Cause]) -> bool:
    """Whether nats lost on held-out readings outweigh those gained on fitted ones.

    They have to outweigh the odds of the least sure cause as well. A law that moves the part as a
    placement does gains next to nothing, since placements are free: its cause was found by the
    rest of its curve.
    """
    odds = min(float(logit(1 - c.none_of_these)) for c in causes)
    return lost > max(gain, odds, 0.0)


def gained(ws: Workspace, model: Model, less: Model) -> float:
    """By how much more probable the fitted readings are under a model than under less, nats."""
    of_each = zip(ws.log_densities(model), ws.log_densities(less), ws.masks(), strict=True)
    return float(sum((after - before)[mask].sum() for after, before, mask in of_each))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Judged:
    """A model on held-out readings, and the causes that are of use there.

    Attributes
    ----------
    before, bare : of the nominal model, with its noise and with that of the recordings
    nominal : the nominal model at its placements
    left : what causes were found by whose laws are of no use there, and that no other one explains
    """

    model: Model
    causes: list[Cause]
    left: list[Unexplained]
    found: tuple[FoundEffect, ...]
    before: Judgement
    bare: Judgement
    after: Judgement
    candidates: Candidates
    nominal: Placed


def _against_claims(
    ready: Prepared, explanation: Explanation, withheld: Collection[str]
) -> tuple[Model, list[FoundEffect], NoiseModel]:
    """Compare noise and placements with what files and poses claim.

    Returns
    -------
    the model, the effects found against claims, and the nominal noise
    """
    model, ws, unexplained = explanation.model, explanation.ws, explanation.unexplained
    # what a law of light leaves of the mean passes for noise that isn't the same throughout;
    # noise that goes with time or the line is the sensor's, and raises the level as well
    light = any(
        c.component is not None and c.component.relaxed.spanned for c in explanation.causes
    )
    left = Left(
        mean=math.hypot(*(s.size for s in unexplained if s.channel == "mean")),
        noise=math.hypot(*(
            s.size for s in unexplained if s.channel == "scale" and (light or not s.of_surface)
        )),
    )  # fmt: skip
    against_claims, plain_noise = texture(ready, explanation, left=left, withheld=withheld)
    if plain_noise is not ready.noise and ready.nominal is not None:
        model = sunken(ws, model, [f.effect for f in against_claims], withheld)
    warped = any(isinstance(e, FormError) and e.coefficients_um for e in model.effects)
    if "pose_error" not in withheld and not warped:
        # what the model takes for physics is no misplacement; a warped part's low waves turn and
        # shift it, so that how it lies can't be told from how the sensor sits
        against_claims += mounted(
            ws, model, [*ready.recorded.recordings, *ready.good],
            {**ready.placed, **explanation.placed}, explanation.held, ready.baseline,
        )  # fmt: skip
    return model, against_claims, plain_noise


def judge_on_heldout(
    ready: Prepared,
    explanation: Explanation,
    model: Model,
    plain_noise: NoiseModel,
    notes: list[str],
) -> _Judged:
    """Judge nominal and found model on held-out readings, without laws that are of no use.

    A cause whose law is of none has no name, unless readings held out show it by themselves. What
    departs is another law's remainder where there is one in its channel; else it is left.
    """
    ws, causes, share_own = explanation.ws, list(explanation.causes), not ready.single
    candidates = candidates_of(
        explanation.recorded, ready.placed, explanation.placed,
        (ready.patches, explanation.patches), ready.noise, share_own=share_own,
    )  # fmt: skip
    nominal = candidates.placed(Model())
    before = judge(nominal.held, plain_noise, Model(), share_own=share_own)
    bare = before
    if plain_noise is not ready.noise:
        bare = judge(nominal.held, ready.noise, Model(), share_own=share_own)
    found, after = found_effects(ws, model, causes, candidates)
    while idle := _idle(found, causes):
        notes.append(f"{', '.join(sorted(idle))}: fitted, but of no use on held-out readings")
        causes = [
            c.doubted(LAW_REFUTED) if c.name in idle else c
            for c in causes if c.name not in idle or c.shown_again
        ]  # fmt: skip
        model = refined(ws, model.without(*idle))
        found, after = found_effects(ws, model, causes, candidates)
    explained = {c.channel for c in causes}
    left = unnamed(c for c in explanation.causes if c.channel not in explained)
    return _Judged(
        model=model, causes=causes, left=left, found=found, before=before, bare=bare, after=after,
        candidates=candidates, nominal=nominal,
    )  # fmt: skip


def _idle(found: Sequence[FoundEffect], causes: Sequence[Cause]) -> set[str]:
    """Name the causes whose laws held-out readings make unlikely; of all, the worst.

    What only the noise told of is weighed with that.
    """
    named = {c.name for c in causes}
    idle = [f for f in found if f.name in named and f.heldout_gain < 0 and not f.law_stands]
    if idle and len(idle) == len(named):
        idle = [min(idle, key=lambda f: f.heldout_gain)]
    return {f.name for f in idle}


def _maps(
    ready: Prepared,
    explanation: Explanation,
    judged: _Judged,
    verdict: str,
    against_claims: Sequence[FoundEffect],
) -> list[RecordingMaps]:
    """Draw each recording's maps; without a place of its own an effect concerns every reading."""
    ws, noise = explanation.ws, ready.noise
    finally_placed = judged.candidates.placed(shrunk(ws, judged.model))
    # a mismatch is held against the noise of an instrument without it
    noise_ratio = 1.0 if ready.nominal is None else ready.nominal.sd_mm / noise.sd_mm
    for blur in blurs(judged.model):
        noise_ratio = max(noise_ratio, 1 / blur.quieter(ws.patches[0].view))
    late = any(isinstance(f.effect, RowRepeat) for f in against_claims)
    maps = [
        map_recording(
            explanation.recorded, k, judged.nominal, finally_placed, noise, usual=noise_ratio,
            late=late,
        )
        for k in range(len(ready.recorded.recordings))
    ]
    if verdict == "match":
        return [m.silenced() for m in maps]
    if against_claims:
        # a change of the noise and a move are everywhere; what stands out are their extremes
        alone = not (judged.causes or explanation.unexplained) and all(
            {*f.effect.channels} <= {"variance", "correlation"}
            or isinstance(f.effect, MotionEffect)
            for f in against_claims
        )
        return [
            m.everywhere(against_claims[-1].name) if alone or not m.mask.any() else m
            for m in maps
        ]
    return maps


def assumed(sheet: Datasheet, given: Datasheet) -> dict[str, object]:
    """Return what the sensor's file didn't state, with the values that suit the readings."""
    of_camera = {
        key: getattr(sheet, key)
        for key in ("triangulation_angle_deg", "camera_side")
        if getattr(sheet, key) != getattr(given, key)
    }
    stated = {e["name"]: e for e in given.effects}
    of_effects = {
        f"{e['name']}.{key}": value
        for e in sheet.effects for key, value in e.items()
        if key not in stated.get(e["name"], e)
    }  # fmt: skip
    return {**of_camera, **of_effects}


def _verdict(named: bool, unexplained: bool) -> str:
    """Sum up: whether causes were named, and whether something is left that none explains."""
    if named:
        return "partly_explained" if unexplained else "explained"
    return "unexplained" if unexplained else "match"


def _none_of_these(causes: Sequence[Cause], against_claims: Sequence[FoundEffect]) -> float:
    """Probability that none of the names given holds, or that what departs has no name at all."""
    if not causes and not against_claims:
        return 1.0
    missed = 1.0
    for held in [1 - c.none_of_these for c in causes] + [f.probability for f in against_claims]:
        missed *= 1 - held
    return float(max(missed, 0.0))
