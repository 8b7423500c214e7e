"""From height maps to a recording: heights up become depth, rows become poses of a straight scan.

The part frame is the instrument's own: x along the columns, y along the rows, z up. The sensor
looks down on it from `working_distance` above its zero, its x along x; so its z is -z, its y, being
z × x, is -y, and `depth = working_distance - height`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sensors.datasheet import Datasheet
from sensors.formats.height_map import Floats, HeightMap
from sensors.recording import Recording, repeated_rows
from sensors.surface.topography import resolution_of
from sensors.typed_yaml import RecipeError

RATE_HZ = 1000.0  # where nothing tells the time


@dataclass(frozen=True, kw_only=True, slots=True)
class Setup:
    """What the user says about how heights were taken; None = as the file says, or assumed.

    `depth`: the readings are distances from the sensor already. `backwards`: the rows follow each
    other along -y. `missing`: the number that stands for a missing point. `z_step_mm`: height of
    one count of an integer file.
    """

    name: str
    pitch_x_mm: float | None = None
    pitch_y_mm: float | None = None
    working_distance_mm: float | None = None
    rate_hz: float | None = None
    z_step_mm: float | None = None
    missing: float | None = None
    depth: bool = False
    backwards: bool = False
    keep_repeated: bool = False


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Imported:
    """The recording, a sensor that fits it, repeated rows dropped, and what was assumed."""

    recording: Recording
    sensor: Datasheet
    repeated: int
    assumed: tuple[str, ...]


def stack(profiles: Sequence[HeightMap]) -> HeightMap:
    """Put single profiles at the same places one after another.

    Raises
    ------
    RecipeError
        Where one of several isn't a single profile, or stands at other places.
    """
    first = profiles[0]
    if len(profiles) == 1:
        return first
    for k, each in enumerate(profiles):
        if each.readings_mm.shape[0] != 1:
            raise RecipeError(
                f"file {k + 1} of several isn't a single profile", value=each.readings_mm.shape
            )
        if each.readings_mm.shape != first.readings_mm.shape:
            raise RecipeError(
                f"file {k + 1} has another number of points than the first",
                value=each.readings_mm.shape[1],
                allowed=str(first.readings_mm.shape[1]),
            )
        if first.x_mm is not None and (
            each.x_mm is None or np.abs(each.x_mm - first.x_mm).max() > 1e-9
        ):
            raise RecipeError(f"file {k + 1} has its points at other places than the first")
    return replace(first, readings_mm=np.concatenate([p.readings_mm for p in profiles]), y_mm=None)


def convert(heights: HeightMap, setup: Setup) -> Imported:
    """Make a recording of a height map; no reading is moved or averaged.

    Raises
    ------
    RecipeError
        Where the pitch is missing, no reading is left, or the working distance is too short.
    """
    readings = _readings(heights, setup)
    rows, columns = readings.shape
    x_mm = _places(heights.x_mm, setup.pitch_x_mm, columns, "x")
    if heights.x_mm is None:
        x_mm = x_mm - x_mm.mean()
    y_mm = np.zeros(1) if rows == 1 else _places(heights.y_mm, setup.pitch_y_mm, rows, "y")
    y_mm = -y_mm if setup.backwards else y_mm
    keep = np.ones(rows, dtype=bool)
    if not setup.keep_repeated:
        keep[1:] = ~(_repeated(readings, heights.intensity)[1:] & (np.diff(y_mm) != 0.0))
    distance, depth = _depth(readings, setup)
    poses = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (rows, 1, 1))
    poses[:, 1, 3] = y_mm
    poses[:, 2, 3] = distance
    rate = setup.rate_hz or RATE_HZ
    time_s = np.arange(rows, dtype=np.float64)[keep] / rate
    assumed = tuple(
        words
        for words, given in (
            (f"working distance {distance:g} mm", setup.working_distance_mm),
            (f"{rate:g} profiles per second", setup.rate_hz),
        )
        if given is None
    )
    notes = [heights.note, *(f"assumed: {words}" for words in assumed)]
    if not keep.all():
        notes.append(f"{int((~keep).sum())} rows that repeated the one before dropped")
    recording = Recording(
        name=setup.name,
        depth_mm=depth[keep],
        poses=poses[keep],
        time_s=time_s - time_s[0],
        intensity=None if heights.intensity is None else heights.intensity[keep],
        x_mm=x_mm,
        comment="; ".join(note for note in notes if note),
    )
    step = setup.z_step_mm or heights.step_mm
    if step is None:
        step = float(f"{resolution_of(readings):.4g}")
    travel = float(np.median(np.abs(np.diff(y_mm)))) if rows > 1 else 0.0
    sensor = Datasheet(
        name=f"{setup.name}, as imported",
        working_distance_mm=distance,
        z_range_mm=_z_range(depth, distance),
        x_fov_mm=float(np.ptp(x_mm)),
        points_per_profile=columns,
        z_resolution_um=float(f"{1000.0 * step:.9g}"),
        profile_rate_hz=rate,
        travel_speed_mm_s=travel * rate if travel > 0.0 else 100.0,
        columns="even_x",
    )
    return Imported(
        recording=recording, sensor=sensor, repeated=int((~keep).sum()), assumed=assumed
    )


def nice_above(value: float) -> float:
    """Return the smallest of 1, 2, 5 × 10^k that isn't below `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    steps = (float(f"{m * power:.3g}") for m in (1.0, 2.0, 5.0, 10.0))
    return next(step for step in steps if step >= value)


def _readings(heights: HeightMap, setup: Setup) -> Floats:
    readings = np.array(heights.readings_mm, dtype=np.float64)
    if readings.ndim != 2 or readings.shape[1] < 2:
        raise RecipeError(
            "holds no grid of readings", value=readings.shape, allowed="rows × 2 columns or more"
        )
    readings[~np.isfinite(readings)] = np.nan
    if setup.missing is not None:
        readings[readings == setup.missing * heights.unit_mm] = np.nan
    if not np.isfinite(readings).any():
        raise RecipeError("holds no reading at all: every point is missing")
    if setup.z_step_mm is not None:
        readings *= setup.z_step_mm / heights.unit_mm
    return readings


def _depth(readings: Floats, setup: Setup) -> tuple[float, Floats]:
    """Return working distance and depths, mm."""
    distance = setup.working_distance_mm
    if setup.depth:
        depth = readings
        if float(np.nanmin(depth)) <= 0.0:
            raise RecipeError(
                "has depths that aren't above 0; are they heights (--height)?",
                value=float(np.nanmin(depth)),
            )
        if distance is None:
            distance = float(f"{np.nanmedian(depth):.4g}")
    else:
        if distance is None:
            distance = nice_above(max(4.0 * float(np.nanmax(np.abs(readings))), 1e-4))
        depth = distance - readings
    low, high = float(np.nanmin(depth)), float(np.nanmax(depth))
    if low <= 0.0 or high >= 1.99 * distance:
        raise RecipeError(
            f"has depths from {low:.4g} to {high:.4g} mm; they don't fit the working distance"
            " (--working-distance-mm)",
            value=distance,
        )
    return distance, depth


def _z_range(depth: Floats, distance: float) -> float:
    reach = 2.0 * float(np.nanmax(np.abs(depth - distance))) * (1.0 + 1e-6)
    return min(nice_above(max(reach, 1e-3 * distance)), 1.999 * distance)


def _places(held: Floats | None, pitch: float | None, count: int, axis: str) -> Floats:
    if held is not None:
        if pitch is None:
            return held
        measured = float(np.median(np.abs(np.diff(held))))
        first = float(held[0])
        return np.asarray(first + (held - first) * (pitch / measured), dtype=np.float64)
    if pitch is None:
        noun = "columns" if axis == "x" else "rows"
        raise RecipeError(f"doesn't say how far apart its {noun} are; give --pitch-{axis}-mm")
    return np.arange(count, dtype=np.float64) * pitch


def _repeated(readings: Floats, intensity: Floats | None) -> NDArray[np.bool_]:
    """Mark rows whose heights and brightness are those of the row before."""
    same = repeated_rows(readings)
    if intensity is not None:
        same[1:] &= (intensity[1:] == intensity[:-1]).all(axis=1)
    return same
