"""From files to readings that can be weighed: checked, registered, looked at, noise calibrated."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.claims.filtered import Filtered
from diagnosis.claims.plate_noise import level_change
from diagnosis.data.albedo import with_brightness
from diagnosis.data.inputs import check_overlap, checked, lateral_mm, tiles
from diagnosis.data.patch import Patch, in_range
from diagnosis.data.recorded import Recorded
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.calibration import calibrated_noise
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.assumed_camera import with_side
from diagnosis.physics.assumed_threshold import with_threshold
from diagnosis.register.placement import Placement
from diagnosis.register.registration import register
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet, with_effects
from sensors.recording import Recording
from sensors.surface.surface import Surface

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Inputs:
    """What a diagnosis is given.

    Attributes
    ----------
    recordings : to fit on; without `holdout`, the last of several is held out, or blocks of one
    vertices_mm, faces : the part's closed mesh, part frame
    surface : nominal roughness, if any is claimed
    references : scans of a flat plate by the same instrument
    baselines : recordings of the part by the same instrument when it was known to be good
    """

    recordings: Sequence[Recording]
    vertices_mm: np.ndarray
    faces: np.ndarray
    datasheet: Datasheet
    surface: Surface | None = None
    references: Sequence[Recording] = ()
    holdout: Sequence[Recording] = ()
    baselines: Sequence[Recording] = ()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Prepared:
    """Recordings where they lie under the nominal model.

    Attributes
    ----------
    placed : placements by name
    good : the baselines, as they are named in `placed`
    patches, baseline : recordings and baselines, looked at from there
    noise, nominal : of the recordings; of plates or baselines where there are any
    surface : with its noise
    fitted, held : names of recordings
    single : whether there is one recording, of which blocks are held out
    filtered : filter that the recordings went through, and neither plates nor baselines did
    """

    recorded: Recorded
    placed: Mapping[str, Placement]
    good: tuple[Recording, ...]
    patches: tuple[Patch, ...]
    baseline: tuple[Patch, ...]
    noise: NoiseModel
    nominal: NoiseModel | None
    surface: Surface | None
    fitted: tuple[str, ...]
    held: tuple[str, ...]
    single: bool
    filtered: Filtered | None = None

    def in_steps(self, step_mm: float) -> "Prepared":
        """Expect the error of counting in steps that plates and baselines don't have."""
        return replace(self, nominal=self.nominal and self.nominal.rounded(step_mm))

    def filtered_by(self, found: Filtered) -> "Prepared":
        """Expect a filter of the firmware in the recordings, where its form is known."""
        if found.unknown > SETTINGS.reported:
            return replace(self, filtered=found)
        sheet = with_effects(self.recorded.datasheet, (found.effect.to_mapping(),))
        recorded = replace(self.recorded, datasheet=sheet)
        patches = tuple(_cut(recorded, self.placed))
        return replace(self, recorded=recorded, patches=patches, filtered=found)


def prepared(inputs: Inputs, notes: list[str], progress: Progress) -> Prepared:
    """Check inputs, register recordings, calibrate the noise.

    Raises
    ------
    RecipeError
        Where the input can't be used.
    """
    if not inputs.recordings:
        raise RecipeError("no recording to diagnose")
    sheet = inputs.datasheet
    scene = Scene(inputs.vertices_mm, inputs.faces)
    fit_on, held = list(inputs.recordings), list(inputs.holdout)
    if not held and len(fit_on) > 1:
        held = [fit_on.pop()]
    single = not held
    everything = [*fit_on, *held]
    good = [replace(b, name=f"baseline {b.name}") for b in inputs.baselines]
    known = checked([*everything, *good], inputs.references, scene, sheet, inputs.surface, notes)
    placed = _registered([*everything, *good], scene, sheet, known.laser, progress)
    bare = scene
    scene, everything = with_brightness(everything, placed, bare, sheet, known.laser)
    if good:  # of another specimen's pattern, or of before
        bare, good = with_brightness(good, placed, bare, sheet, known.laser)
    recorded = Recorded(
        recordings=tuple(everything), scene=scene, datasheet=sheet, laser=known.laser,
        lateral_mm=lateral_mm(everything[0]),
        held_out=tuple(
            tiles(*r.depth_mm.shape) if single else np.full(r.depth_mm.shape, k >= len(fit_on))
            for k, r in enumerate(everything)
        ),
    )  # fmt: skip
    theirs = replace(
        recorded, recordings=tuple(good), scene=bare,
        held_out=tuple(np.zeros(r.depth_mm.shape, dtype=bool) for r in good),
    )  # fmt: skip
    patches, baseline = _cut(recorded, placed), _cut(theirs, placed)
    progress("calibrating the noise")
    for completed in (with_side, with_threshold):
        complete = completed(recorded.datasheet, patches, baseline)
        if complete is not recorded.datasheet:
            recorded, theirs = (replace(r, datasheet=complete) for r in (recorded, theirs))
            patches, baseline = _cut(recorded, placed), _cut(theirs, placed)
    noise, nominal = calibrated_noise(patches, known.plates, notes)
    if baseline:
        nominal = _nominal_of(baseline)
    return Prepared(
        recorded=recorded, placed=placed, good=tuple(good),
        patches=tuple(patches), baseline=tuple(baseline),
        noise=noise, nominal=nominal, surface=known.surface,
        fitted=tuple(r.name for r in fit_on), held=tuple(r.name for r in held), single=single,
    )  # fmt: skip


def _cut(recorded: Recorded, placed: Mapping[str, Placement]) -> list[Patch]:
    """Look at all recordings from where they lie."""
    patches = [
        p for k, r in enumerate(recorded.recordings) for p in recorded.cut(k, placed[r.name])
    ]
    check_overlap(patches)
    return patches


def _nominal_of(baseline: Sequence[Patch]) -> NoiseModel:
    """Noise of the part when the instrument was good, of a size measured as a change of it is."""
    noise, _ = calibrated_noise(baseline, (), [])
    change = level_change(Workspace.build(baseline, noise), Model(), noise.sd_mm)
    return replace(noise, sd_mm=noise.sd_mm * math.exp(change.log))


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
