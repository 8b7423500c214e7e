"""The whole diagnosis: register, calibrate, detect, explain, judge, locate."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.brightness import surface_brightness
from diagnosis.empirical_fit import fit_empirical
from diagnosis.finding import Finding
from diagnosis.finish import finish_effects, finish_intervals
from diagnosis.heldout import Judgement, judge, judging_masks
from diagnosis.locate import Region
from diagnosis.maps import RecordingMaps, map_recording
from diagnosis.mounting import Mounting, mounting_error
from diagnosis.noise import Field, Mask, NoiseModel, calibrate
from diagnosis.patch import Patch, cut, in_range
from diagnosis.plates import plate_residual
from diagnosis.prediction import plain_gain, predict
from diagnosis.registration import Placement, register
from diagnosis.score import log_density, placements, whitened
from diagnosis.select import Choice, Selection, drop_idle, refit_linear, select
from diagnosis.uncertainty import intervals
from diagnosis.workspace import Model, Workspace
from sensors.covariates import COVARIATES
from sensors.datasheet import Datasheet, with_effects
from sensors.effects.base import Effect
from sensors.laser import Laser
from sensors.law import geometric_law
from sensors.recording import Recording
from sensors.scene import Scene
from sensors.surface import Surface
from sensors.typed_yaml import RecipeError
from sensors.uncertainty import sigma_mm
from sensors.view import View

Progress = Callable[[str], None]
STILL_BENT = 0.4
"""Departure of the mean, in units of the noise, that is never passed over as a remainder."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FoundEffect:
    """One effect of the diagnosis as it is reported."""

    name: str
    effect: Effect
    statement: str
    parameters: dict[str, tuple[float, float, float]]
    heldout_gain: float
    covariate: str
    covariate_key: str
    frame: str
    alternatives: tuple[tuple[str, float], ...]
    separating: str


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Diagnosis:
    """Everything a report needs."""

    verdict: str
    effects: tuple[FoundEffect, ...]
    left: tuple[Finding, ...]
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
    _check_names([*recordings, *holdout])
    scene = Scene(vertices_mm, faces)
    rng = np.random.default_rng(seed)
    notes: list[str] = []
    fit_on, held = list(recordings), list(holdout)
    if not held and len(fit_on) > 1:
        held = [fit_on.pop()]
    tiles = not held
    fit_on, held = [_settled_brightness(r) for r in fit_on], [_settled_brightness(r) for r in held]
    everything = [*fit_on, *held]
    laser = {r.name: _laser(datasheet, r) for r in everything}
    for r in everything:
        _check_fits(datasheet, r, notes)

    placed: dict[str, Placement] = {}
    patches: list[Patch] = []
    lateral = _lateral_mm(everything[0])
    for number, recording in enumerate(everything):
        progress(f"registering {recording.name}")
        valid = np.isfinite(in_range(recording.depth_mm, datasheet))
        placement = register(
            scene, recording, laser[recording.name], valid=valid, sd_mm=datasheet.step_mm / 2
        )
        placed[recording.name] = placement
        n, m = recording.depth_mm.shape
        if tiles:
            held_out: Mask | None = _tiles(n, m)
        else:
            held_out = np.ones((n, m), dtype=bool) if recording in held else None
        patches += cut(
            number, recording, placement, scene, datasheet, laser[recording.name],
            lateral_mm=lateral, held_out=held_out,
        )  # fmt: skip
    _check_overlap(patches)
    progress("calibrating the noise")
    noise, nominal = _noise(patches, references, datasheet, notes)
    ws = Workspace.build([p for p in patches if p.fit.any()], noise)
    _note_repeats(everything, notes)

    selection = select(ws, rng, withheld=withheld, progress=progress)
    model = selection.model
    plain_held = [p for p in patches if p.scored.any()]
    if model.effects:
        progress("registering again under the model")
        patches = _registered_under(
            model, patches, everything, scene, datasheet, laser, placed, noise, lateral
        )
        ws = Workspace.build([p for p in patches if p.fit.any()], noise)
        model, kept = drop_idle(ws, refit_linear(ws, model), selection.choices, rng)
        selection = replace(selection, choices=kept)
    verdict, left = _verdict(selection)
    finishes, finish_findings = finish_effects(
        ws, model, noise, nominal, _nominal_sd_mm(nominal, surface, ws.patches[0].view)
    )
    finishes = [e for e in finishes if e.name not in set(withheld)]
    mounting = None
    if "pose_error" not in set(withheld):
        mounting = mounting_error([r.poses for r in fit_on], [placed[r.name] for r in fit_on])
    if verdict == "match" and (finishes or mounting):
        verdict = "explained"
    elif verdict == "match" and finish_findings:
        verdict, left = "unexplained", finish_findings
    elif verdict == "unexplained" and (finishes or mounting):
        verdict = "partly_explained"
    if verdict in ("unexplained", "partly_explained"):
        progress("describing what is left")
        empirical = fit_empirical(ws, model, left)
        if empirical is not None:
            model = model.with_effect(empirical)
    held_patches = [p for p in patches if p.scored.any()]
    progress("judging on held-out readings")
    share_own = not tiles
    before = judge(plain_held, noise, Model(), share_own=share_own)
    after = judge(held_patches, noise, model, share_own=share_own)
    progress("intervals")
    fit_patches = list(ws.patches)
    found = _found(ws, model, selection, held_patches, noise, after, share_own)
    if finishes:
        plain_noise = _nominal_noise(noise, nominal, surface, fit_patches[0].view)
        before = judge(plain_held, plain_noise, Model(), share_own=share_own)
        found += tuple(
            _plainly(e, before.log_score - after.log_score, finish_intervals(e)) for e in finishes
        )
    if mounting is not None:
        gain = _commanded_gain(
            everything, held_patches, scene, datasheet, laser, noise, mounting, lateral
        )
        found += (_plainly(mounting.effect, gain, mounting.intervals),)
    progress("drawing maps")
    settled, shifts = _settled(patches, noise, model, share_own)
    maps = [
        map_recording(
            k, r, placed[r.name], scene, datasheet, laser[r.name], noise, settled, shifts, lateral
        )
        for k, r in enumerate(everything)
    ]
    if verdict == "match":
        maps = [m.silenced() for m in maps]
    elif finishes or mounting is not None:
        maps = [m.everywhere(found[-1].name) if not m.mask.any() else m for m in maps]
    regions = tuple(region for m in maps for region in m.regions)
    counted = sum(m.mask.size for m in maps)
    sheet = with_effects(datasheet, tuple(f.effect.shared().to_mapping() for f in found))
    return Diagnosis(
        verdict=verdict,
        effects=found,
        left=tuple(left),
        found=tuple(selection.first.significant()),
        regions=regions,
        share_of_points=float(sum(m.mask.sum() for m in maps)) / max(counted, 1),
        before=before,
        after=after,
        maps=tuple(maps),
        datasheet=sheet,
        model=model,
        noise=noise,
        threshold=selection.first.threshold,
        fitted=tuple(r.name for r in fit_on),
        held=tuple(r.name for r in held),
        held_patches=tuple(held_patches),
        fit_patches=tuple(fit_patches),
        notes=tuple(notes),
        seed=seed,
    )


def _registered_under(
    model: Model,
    patches: Sequence[Patch],
    recordings: Sequence[Recording],
    scene: Scene,
    datasheet: Datasheet,
    laser: dict[str, Laser],
    placed: dict[str, Placement],
    noise: NoiseModel,
    lateral: float,
) -> list[Patch]:
    """Place each recording anew with the effects in the model.

    Under the plain model a placement gives way to what it lacks, by tenths of a millimetre where
    the part is smooth: far enough for curvature to bend what was linear. Recordings that are
    looked at in strips stay where they are.
    """
    out: list[Patch] = []
    for number, recording in enumerate(recordings):
        own = [p for p in patches if p.recording == number]
        if len(own) > 1 or own[0].shape[0] < recording.depth_mm.shape[0]:
            out += own
            continue
        patch = own[0]
        mean = predict(patch.view, model.of(number), noise, softness=patch.softness).mean_mm
        placement = register(
            scene,
            recording,
            laser[recording.name],
            valid=patch.observed,
            offset_mm=np.nan_to_num(mean - patch.view.depth_mm),
            sd_mm=noise.sd_mm,
        )
        again = cut(
            number, recording, placement, scene, datasheet, laser[recording.name],
            lateral_mm=lateral, held_out=patch.scored,
        )  # fmt: skip
        placed[recording.name] = placement
        out += again
    return out


def _verdict(selection: Selection) -> tuple[str, list[Finding]]:
    """Judge what the findings before and after the explanation amount to."""
    first, last = selection.first.significant(), selection.last.significant()
    if not first:
        return "match", []
    if not selection.choices:
        return "unexplained", last or first
    explained = sum(c.gain for c in selection.choices)
    rest = max((f.gain for f in last), default=0.0)
    bent = any(f.channel == "mean" and f.size > STILL_BENT for f in last)
    if not last or (rest < 0.05 * explained and not bent):
        return "explained", []
    if rest > 2 * explained:
        return "unexplained", last
    return "partly_explained", last


def _found(
    ws: Workspace,
    model: Model,
    selection: Selection,
    held: Sequence[Patch],
    noise: NoiseModel,
    after: Judgement,
    share_own: bool,
) -> tuple[FoundEffect, ...]:
    chosen: dict[str, Choice] = {c.name: c for c in selection.choices}
    bounds = intervals(ws, model)
    out = []
    for effect in model.effects:
        rest = model.without(effect.name)
        if len(rest.effects) > 1 or (rest.effects and rest.effects[0].name != "empirical"):
            rest = refit_linear(ws, rest)
        without = judge(held, noise, rest, share_own=share_own)
        choice = chosen.get(effect.name)
        rivals = choice.alternatives if choice else ()
        covariate = COVARIATES[getattr(effect, "against", effect.covariate)]
        statement = effect.describe()
        if rivals:
            names = " or ".join(name for name, _ in rivals)
            statement += (
                f" These recordings can't tell it from {names}; to separate them: "
                f"{effect.separating}."
            )
        out.append(
            FoundEffect(
                name=effect.name,
                effect=effect,
                statement=statement,
                parameters=bounds.get(effect.name, {}),
                heldout_gain=without.log_score - after.log_score,
                covariate=covariate.words,
                covariate_key=covariate.name,
                frame=covariate.frame if effect.name == "empirical" else effect.frame,
                alternatives=tuple((n, g / max(ws.count(), 1)) for n, g in rivals),
                separating=effect.separating,
            )
        )
    return tuple(sorted(out, key=lambda f: -f.heldout_gain))


def _plainly(
    effect: Effect, gain: float, parameters: dict[str, tuple[float, float, float]]
) -> FoundEffect:
    """Report an effect that was measured by itself."""
    covariate = COVARIATES[effect.covariate]
    return FoundEffect(
        name=effect.name,
        effect=effect,
        statement=effect.describe(),
        parameters=parameters,
        heldout_gain=gain,
        covariate=covariate.words,
        covariate_key=covariate.name,
        frame=effect.frame,
        alternatives=(),
        separating=effect.separating,
    )


def _commanded_gain(
    recordings: Sequence[Recording],
    held: Sequence[Patch],
    scene: Scene,
    datasheet: Datasheet,
    laser: dict[str, Laser],
    noise: NoiseModel,
    mounting: Mounting,
    lateral: float,
) -> float:
    """Nats per held-out reading that a common offset gains at commanded poses."""
    names = {p.recording for p in held}
    total, count = 0.0, 0.0
    for number, recording in enumerate(recordings):
        if number not in names:
            continue
        stay = Placement(
            shift=np.zeros(7),
            centre_mm=np.zeros(3),
            covariance=np.eye(7),
            poses=recording.poses,
        )
        for patch in cut(
            number, recording, stay, scene, datasheet, laser[recording.name], lateral_mm=lateral,
            held_out=np.ones(recording.depth_mm.shape, dtype=bool),
        ):  # fmt: skip
            scores = [
                log_density(
                    patch,
                    predict(patch.view, e, noise, softness=patch.softness),
                    noise,
                    np.zeros(7),
                )
                for e in ((), (mounting.effect,))
            ]
            total += float((scores[1] - scores[0]).sum())
            count += float(patch.counted.sum())
    return total / max(count, 1.0)


def _nominal_sd_mm(nominal: NoiseModel | None, surface: Surface | None, view: View) -> float:
    """Size of the noise that plates or the surface's file claim; 0 where neither does."""
    if nominal is not None:
        return nominal.sd_mm
    if surface is None:
        return 0.0
    law = geometric_law(view, surface)
    return float(np.hypot(sigma_mm(view.datasheet), law.speckle_sd_mm(view)))


def _nominal_noise(
    noise: NoiseModel, nominal: NoiseModel | None, surface: Surface | None, view: View
) -> NoiseModel:
    """Return the noise as the plain model has it."""
    if nominal is not None and nominal.acf.shape == noise.acf.shape:
        return nominal
    return replace(noise, sd_mm=_nominal_sd_mm(nominal, surface, view))


def _settled(
    patches: Sequence[Patch], noise: NoiseModel, model: Model, share_own: bool
) -> tuple[Model, dict[str, dict[int, Field]]]:
    """Return the model with held-out recordings' own parameters, and each one's placements.

    Placements are those under the "plain" and the "final" model, by recording.
    """
    from diagnosis.heldout import settle_own

    out: dict[str, dict[int, Field]] = {}
    ws = Workspace.build(patches, noise)
    if share_own:
        held = [p for p in patches if p.scored.any()]
        small, _ = judging_masks(held, True)
        settled = settle_own(Workspace.build(held, noise), model, small)
        own = {**{k: dict(v) for k, v in model.own.items()}}
        for r, values in settled.own.items():
            own.setdefault(r, {}).update(
                {k: v for k, v in values.items() if k not in own.get(r, {})}
            )
        model = replace(model, own=own)
    for name, which in (("plain", Model()), ("final", model)):
        predictions = ws.predict(which)
        raw = [whitened(p, q, noise) for p, q in zip(patches, predictions, strict=True)]
        out[name] = placements(patches, raw, [p.counted for p in patches])
    return model, out


def _noise(
    patches: Sequence[Patch],
    references: Sequence[Recording],
    datasheet: Datasheet,
    notes: list[str],
) -> tuple[NoiseModel, NoiseModel | None]:
    """Correlation and size from the recordings' own residuals, losses and tails from plates."""
    fields, masks = [], []
    for patch in patches:
        mask = (
            patch.fit & patch.observed & np.isfinite(patch.plain_mm) & ~patch.edge & patch.counted
        )
        if mask.any():
            fields.append((patch.depth_mm - patch.plain_mm) / plain_gain(patch.view))
            masks.append(mask)
    if not masks or sum(int(m.sum()) for m in masks) < 100:
        fields = [p.depth_mm - p.plain_mm for p in patches]
        masks = [p.observed & np.isfinite(p.plain_mm) & p.fit for p in patches]
    pitch = _pitch(patches[0])
    own = calibrate(fields, masks, pitch_mm=pitch, missing_share=0.0, from_reference=False)
    own = replace(own, tail_share=0.0, tail_sd_mm=8 * own.sd_mm)
    if not references:
        return own, None
    plates = [plate_residual(r, datasheet) for r in references]
    reference = calibrate(
        [p.residual_mm for p in plates],
        [np.isfinite(p.residual_mm) for p in plates],
        pitch_mm=plates[0].pitch_mm,
        missing_share=float(np.mean([p.missing_share for p in plates])),
        from_reference=True,
    )
    ratio = own.sd_mm / reference.sd_mm
    notes.append(
        f"noise: {1e3 * own.sd_mm:.1f} µm on the part, {1e3 * reference.sd_mm:.1f} µm on the plate"
        f" (ratio {ratio:.2f})"
    )
    own = replace(
        own,
        tail_share=reference.tail_share,
        tail_sd_mm=max(reference.tail_sd_mm, 8 * own.sd_mm),
        missing_share=reference.missing_share,
        from_reference=True,
    )
    return own, reference.at_pitch(*pitch)


def _pitch(patch: Patch) -> tuple[float, float]:
    x = patch.view.column_x_mm
    travel = np.abs(np.diff(patch.view.travel_mm))
    return float(np.median(np.abs(np.diff(x)))), float(np.median(travel)) if travel.size else 1.0


def _lateral_mm(recording: Recording) -> float:
    """How far edges may be off sideways: a twentieth of the profile pitch, at least 15 µm."""
    step = np.linalg.norm(np.diff(recording.poses[:, :3, 3], axis=0), axis=1)
    return float(np.clip(0.05 * np.median(step), 0.015, 0.05))


def _tiles(profiles: int, points: int) -> Mask:
    """Blocks of a single recording that are held out: a quarter, spread over it."""
    rows = (np.arange(profiles) * 6 // profiles)[:, None]
    columns = (np.arange(points) * 6 // points)[None]
    return np.asarray((rows + 2 * columns) % 4 == 0)


def _laser(datasheet: Datasheet, recording: Recording) -> Laser:
    points = recording.depth_mm.shape[1]
    try:
        return Laser.from_datasheet(datasheet, points=points, x_mm=recording.x_mm)
    except RecipeError as error:
        raise RecipeError(str(error), where=recording.name) from None


def _settled_brightness(recording: Recording) -> Recording:
    if recording.intensity is None:
        return recording
    return replace(recording, intensity=surface_brightness(recording.intensity))


def _check_names(recordings: Sequence[Recording]) -> None:
    names = [r.name for r in recordings]
    for name in names:
        if names.count(name) > 1:
            raise RecipeError("two recordings have the same name", value=name)


def _check_fits(datasheet: Datasheet, recording: Recording, notes: list[str]) -> None:
    """Refuse a sensor that can't have delivered the recording."""
    if recording.depth_mm.shape[0] < 2:
        raise RecipeError(
            "holds a single profile; a diagnosis needs at least 2", where=recording.name
        )
    known = recording.depth_mm[np.isfinite(recording.depth_mm)]
    low, high = datasheet.depth_min_mm, datasheet.depth_max_mm
    inside = (known >= low) & (known <= high)
    if inside.mean() < 0.5:
        middle = float(np.median(known))
        for factor, unit in ((1000.0, "metres"), (25.4, "inches"), (1e-3, "micrometres")):
            if low <= middle * factor <= high:
                raise RecipeError(
                    f"depths don't fit the sensor's range but would if they were in {unit}; "
                    "/depth is in mm",
                    where=recording.name, value=round(middle, 4), allowed=f"{low:g} to {high:g} mm",
                )  # fmt: skip
        raise RecipeError(
            "this sensor can't have delivered it: most depths are out of its range",
            where=recording.name, value=round(middle, 4), allowed=f"{low:g} to {high:g} mm",
        )  # fmt: skip
    if inside.mean() < 1:
        notes.append(
            f"{recording.name}: {(~inside).sum()} readings outside the working range count as "
            "missing"
        )
    if recording.depth_mm.shape[1] != datasheet.points_per_profile:
        notes.append(
            f"{recording.name}: {recording.depth_mm.shape[1]} points a profile, the sensor's file "
            f"says {datasheet.points_per_profile}: taken as spread over the same field of view"
        )


def _check_overlap(patches: Sequence[Patch]) -> None:
    for patch in patches:
        if not (patch.observed & np.isfinite(patch.plain_mm)).any() and patch.observed.any():
            raise RecipeError("nowhere meets the part after registration", where=patch.name)


def _note_repeats(recordings: Sequence[Recording], notes: list[str]) -> None:
    from sensors.recording import repeated_rows

    for r in recordings:
        count = int(repeated_rows(r.depth_mm).sum())
        if count:
            notes.append(
                f"{r.name}: {count} of {len(r.depth_mm)} profiles repeat the one before, "
                "reading for reading; they measured nothing and are left out"
            )
