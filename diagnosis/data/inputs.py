"""What a diagnosis is given: checked, and refused with a reason where it can't be used."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.data.patch import Patch, in_range
from diagnosis.data.plates import Plate, plate_residual
from diagnosis.fields import Mask
from diagnosis.noise.noise_model import LAG_PART
from diagnosis.predict.prediction import law_of
from diagnosis.register.sample import check_meets
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.formats.plausibility import sentinels
from sensors.model import SensorModel
from sensors.noise.perlin import grid_pitch
from sensors.recording import Recording
from sensors.surface.surface import Surface
from sensors.view.view import View

CHECKED_PROFILES = 16
"""Profiles in the middle of a recording on which the files' nominal model is computed to check it.

A part of the profiles suffices: a key that is missing is missing in each.
"""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Checked:
    """What was checked before any work: rays, plates, and a surface that has its noise.

    Attributes
    ----------
    laser : of each recording, by its name
    """

    laser: dict[str, Laser]
    plates: tuple[Plate, ...]
    surface: Surface | None


def checked(
    recordings: Sequence[Recording],
    references: Sequence[Recording],
    scene: Scene,
    datasheet: Datasheet,
    surface: Surface | None,
    notes: list[str],
) -> Checked:
    """Check all that is given, before the first registration.

    Raises
    ------
    RecipeError
        Where an input can't be used.
    """
    check_names(recordings)
    laser = {r.name: laser_of(datasheet, r) for r in recordings}
    for recording in (*recordings, *references):
        check_marks(datasheet, recording)
    for recording in recordings:
        check_fits(datasheet, recording, notes)
        valid = np.isfinite(in_range(recording.depth_mm, datasheet))
        check_meets(scene, recording, laser[recording.name], valid=valid)
    check_nominal(scene, datasheet, recordings[0], laser[recordings[0].name])
    if surface is not None and not references:
        surface = ready_surface(surface, datasheet, recordings[0], laser[recordings[0].name])
    plates = tuple(plate_residual(r, datasheet) for r in references)
    return Checked(laser=laser, plates=plates, surface=surface)


def check_nominal(
    scene: Scene, datasheet: Datasheet, recording: Recording, laser: Laser
) -> None:
    """Refuse a sensor's file from which its own effects can't be computed."""
    middle = len(recording.poses) // 2
    start = max(middle - CHECKED_PROFILES // 2, 0)
    rows = slice(start, start + CHECKED_PROFILES)
    bright = None if recording.intensity is None else recording.intensity[rows]
    view = View(
        scene, SensorModel(datasheet), recording.poses[rows], recording.time_s[rows], laser=laser,
        intensity=bright, start_time_s=recording.start_time_s,
    )  # fmt: skip
    law_of(view, (), None)


def ready_surface(
    surface: Surface, datasheet: Datasheet, recording: Recording, laser: Laser
) -> Surface:
    """Return a surface with the noise that has its figures at a recording's pitch."""
    step = np.linalg.norm(np.diff(recording.poses[:, :3, 3], axis=0), axis=1)
    columns_mm = laser.x_mm + datasheet.working_distance_mm * laser.slope_x
    return surface.ready(
        grid_pitch(columns_mm) or None,
        grid_pitch(np.concatenate([[0.0], np.cumsum(step)])) or None,
        z_resolution_um=datasheet.z_resolution_um,
        repeatability_um=datasheet.repeatability_um or 0.0,
    )


def check_names(recordings: Sequence[Recording]) -> None:
    """Refuse two recordings of one name."""
    names = [r.name for r in recordings]
    for name in names:
        if names.count(name) > 1:
            raise RecipeError("two recordings have the same name", value=name)


def check_marks(datasheet: Datasheet, recording: Recording) -> None:
    """Refuse depths that can be no readings: one number beyond the range, apart, that repeats.

    Within the range a number that repeats may be a plane that was seen without noise.
    """
    low, high = datasheet.depth_min_mm, datasheet.depth_max_mm
    for mark in sentinels(recording.depth_mm):
        if not low <= mark.value <= high:
            raise RecipeError(
                f"holds what looks like a mark for missing points: depth {mark.value:.9g} mm "
                f"{mark.count} times, all else lies in {mark.low:.6g} to {mark.high:.6g} mm",
                where=recording.name,
                allowed="NaN for missing: import the instrument's file again, with --missing and "
                "the mark as it stands there",
            )


def check_fits(datasheet: Datasheet, recording: Recording, notes: list[str]) -> None:
    """Refuse a sensor that can't have delivered the recording."""
    if len(recording.depth_mm) < LAG_PART:
        raise RecipeError(
            "holds too few profiles: how noise is correlated along the travel can't be estimated",
            where=recording.name, value=len(recording.depth_mm), allowed=f"at least {LAG_PART}",
        )  # fmt: skip
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
    placed = recording.x_mm is not None or recording.ray_x_mm is not None
    if not placed and recording.depth_mm.shape[1] != datasheet.points_per_profile:
        notes.append(
            f"{recording.name}: {recording.depth_mm.shape[1]} points a profile, the sensor's file "
            f"says {datasheet.points_per_profile}: taken as spread over the same field of view"
        )


def check_overlap(patches: Sequence[Patch]) -> None:
    """Refuse a recording that meets the part nowhere."""
    for patch in patches:
        if not (patch.observed & np.isfinite(patch.plain_mm)).any() and patch.observed.any():
            raise RecipeError("nowhere meets the part after registration", where=patch.name)


def laser_of(datasheet: Datasheet, recording: Recording) -> Laser:
    """Return the rays of a recording's columns."""
    try:
        return Laser.of_recording(datasheet, recording)
    except RecipeError as error:
        raise RecipeError(str(error), where=recording.name) from None


def lateral_mm(recording: Recording) -> float:
    """How far edges may be off sideways: a share of the profiles' pitch, within bounds."""
    step = np.linalg.norm(np.diff(recording.poses[:, :3, 3], axis=0), axis=1)
    share = SETTINGS.data.lateral_pitches * np.median(step)
    return float(np.clip(share, SETTINGS.data.least_lateral_mm, SETTINGS.data.most_lateral_mm))


def tiles(profiles: int, points: int) -> Mask:
    """Blocks of a single recording that are held out: a quarter, spread over it."""
    rows = (np.arange(profiles) * 6 // profiles)[:, None]
    columns = (np.arange(points) * 6 // points)[None]
    return np.asarray((rows + 2 * columns) % 4 == 0)
