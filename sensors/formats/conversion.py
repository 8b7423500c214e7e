"""From height maps to a recording: heights up become depth, rows become poses of a straight scan.

The part frame is the instrument's own: x along the columns, y along the rows, z up. The sensor
looks down on it from `working_distance` above its zero, its x along x; so its z is -z, its y, being
z × x, is -y, and `depth = working_distance - height`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.datasheet import Datasheet
from sensors.formats.height_map import Floats, HeightMap
from sensors.formats.motion import Rows
from sensors.formats.plausibility import check_sentinels, check_sizes
from sensors.recording import Recording, repeated_rows
from sensors.surface.topography import resolution_of

RATE_HZ = 1000.0  # where nothing tells the time
SAME_PLACE = 0.02  # of the pitch: nearer places are one, printed differently
MOST_UNION = 4  # times the longest profile: more columns than that are no common lattice


@dataclass(frozen=True, kw_only=True, slots=True)
class Setup:
    """What the user says about how heights were taken; None = as the file says, or assumed.

    `depth`: the readings are distances from the sensor already. `backwards`: the rows follow each
    other along -y. `missing`: the numbers that stand for a missing point. `z_step_mm`,
    `z_offset_mm`: height of one count of an integer file, and of its count 0. `flip_x`: columns run
    against x. `poses`: of each row, sensor to part. `checked`: whether what looks wrong is refused.
    `unit_given`: whether the user named the unit. `optical_axis_x_mm`: the sensor's own. `options`:
    what was asked for, kept in the recording so that it can be repeated.
    """

    name: str
    pitch_x_mm: float | None = None
    pitch_y_mm: float | None = None
    working_distance_mm: float | None = None
    optical_axis_x_mm: float = 0.0
    rate_hz: float | None = None
    z_step_mm: float | None = None
    z_offset_mm: float = 0.0
    missing: tuple[float, ...] = ()
    depth: bool = False
    backwards: bool = False
    keep_repeated: bool = False
    flip_x: bool = False
    start_time_s: float | None = None
    poses: Floats | None = None
    rows: Rows | None = None
    checked: bool = True
    unit_given: bool = False
    options: str = ""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Imported:
    """The recording, a sensor that fits it, repeated rows dropped, and what was assumed."""

    recording: Recording
    sensor: Datasheet
    repeated: int
    assumed: tuple[str, ...]
    decisions: tuple[str, ...] = ()


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
        if (each.x_mm is None) != (first.x_mm is None):
            raise RecipeError(f"file {k + 1} has its points at other places than the first")
        if each.x_mm is None and each.readings_mm.shape != first.readings_mm.shape:
            raise RecipeError(
                f"file {k + 1} has another number of points than the first",
                value=each.readings_mm.shape[1],
                allowed=str(first.readings_mm.shape[1]),
            )
    if all(_same_places(each, first) for each in profiles):
        readings = np.concatenate([each.readings_mm for each in profiles])
        return replace(first, readings_mm=readings, y_mm=None)
    return _union(profiles)


def _same_places(one: HeightMap, other: HeightMap) -> bool:
    if one.x_mm is None or other.x_mm is None:
        return True
    return one.x_mm.shape == other.x_mm.shape and bool(np.abs(one.x_mm - other.x_mm).max() < 1e-9)


def _union(profiles: Sequence[HeightMap]) -> HeightMap:
    """Put profiles on the union of their lattices; a profile is missing where it has no point."""
    held = [each.x_mm for each in profiles if each.x_mm is not None]
    pitch = min(float(np.median(np.abs(np.diff(x)))) for x in held)
    every = np.unique(np.concatenate(held))
    group = np.concatenate([[0], np.cumsum(np.diff(every) > SAME_PLACE * pitch)])
    places = np.bincount(group, every) / np.bincount(group)
    if len(places) > MOST_UNION * max(len(x) for x in held):
        raise RecipeError(
            f"several profiles stand at {len(places)} different places; nothing is resampled",
            allowed="profiles whose points share a lattice",
        )
    readings = np.full((len(profiles), len(places)), np.nan)
    for row, (each, x) in enumerate(zip(profiles, held, strict=True)):
        column = group[np.searchsorted(every, x)]
        readings[row, column] = each.readings_mm[0]
    words = f"profiles at different places: the union of their lattices has {len(places)} columns"
    return replace(
        profiles[0], readings_mm=readings, x_mm=places, y_mm=None, intensity=None,
        decisions=(*profiles[0].decisions, words),
    )  # fmt: skip


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
    y_mm = _rows_at(heights, setup, rows)
    odd: tuple[str, ...] = ()
    if setup.checked:
        stated = heights.unit_stated or setup.unit_given or setup.z_step_mm is not None
        odd = check_sizes(stated, readings, x_mm, y_mm, heights.x_mm is not None)
    x_mm = -x_mm if setup.flip_x else x_mm
    keep = np.ones(rows, dtype=bool)
    if not setup.keep_repeated:
        keep[1:] = ~(_repeated(readings, heights.intensity)[1:] & (np.diff(y_mm) != 0.0))
    distance, depth = _depth(readings, setup)
    poses = setup.poses
    if poses is None:
        poses = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (rows, 1, 1))
        poses[:, 1, 3] = y_mm
        poses[:, 2, 3] = distance
    elif len(poses) != rows:
        raise RecipeError(
            "has another number of rows than poses", value=rows, allowed=str(len(poses))
        )
    time_s, rate, timed = _times(heights, setup, rows)
    ray_x, ray_slope = _rays(heights, setup, x_mm, distance)
    # Where the columns lie at the working distance.
    seen_mm = x_mm if ray_x is None or ray_slope is None else ray_x + ray_slope * distance
    assumed = tuple(
        words
        for words, given in (
            (f"working distance {distance:g} mm", setup.working_distance_mm),
            (f"{rate:g} profiles per second", setup.rate_hz or timed or None),
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
        time_s=time_s[keep] - time_s[keep][0],
        intensity=None if heights.intensity is None else heights.intensity[keep],
        x_mm=x_mm if ray_slope is None else None,
        ray_x_mm=ray_x,
        ray_slope=ray_slope,
        start_time_s=setup.start_time_s,
        import_options=setup.options,
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
        x_fov_mm=float(np.ptp(seen_mm)),
        points_per_profile=columns,
        z_resolution_um=float(f"{1000.0 * step:.9g}"),
        profile_rate_hz=rate,
        travel_speed_mm_s=travel * rate if travel > 0.0 else 100.0,
        columns="even_x",
        optical_axis_x_mm=setup.optical_axis_x_mm,
    )
    return Imported(
        recording=recording, sensor=sensor, repeated=int((~keep).sum()), assumed=assumed,
        decisions=(*heights.decisions, *odd),
    )  # fmt: skip


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
    values = readings / heights.unit_mm
    for mark in setup.missing:
        # The nearest number that the file's own precision holds, -99.9999 as a float32 included.
        single = np.float64(np.float32(mark))
        readings[np.isclose(values, mark, rtol=1e-12, atol=0.0) | (values == single)] = np.nan
    if not np.isfinite(readings).any():
        raise RecipeError("holds no reading at all: every point is missing")
    if setup.checked:
        check_sentinels(np.where(np.isfinite(readings), values, np.nan))
    if setup.z_step_mm is not None:
        readings *= setup.z_step_mm / heights.unit_mm
    return readings + setup.z_offset_mm


def _rows_at(heights: HeightMap, setup: Setup, rows: int) -> Floats:
    """Return where the rows are, mm: as the user's file says, the instrument's, or by the pitch."""
    if setup.poses is not None and len(setup.poses) == rows:
        way = np.diff(setup.poses[:, :3, 3], axis=0)
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(way, axis=1))])
    held, counts = heights.y_mm, heights.row_counts
    if setup.rows is not None and setup.rows.y_mm is not None:
        held, counts = setup.rows.y_mm, setup.rows.counts
    if held is not None and len(held) != rows:
        raise RecipeError(
            "has another number of rows than --rows", value=rows, allowed=str(len(held))
        )
    if rows == 1:
        return np.zeros(1)
    if counts and setup.pitch_y_mm is None:
        raise RecipeError(
            "gives its rows' places in counts of an encoder; give --pitch-y-mm, the distance from "
            "row to row"
        )
    y_mm = _places(held, setup.pitch_y_mm, rows, "y")
    return -y_mm if setup.backwards else y_mm


def _times(heights: HeightMap, setup: Setup, rows: int) -> tuple[Floats, float, bool]:
    """Return times of the rows, their rate, and whether anybody stated them."""
    held = heights.time_s if setup.rows is None or setup.rows.time_s is None else setup.rows.time_s
    if held is not None and setup.rate_hz is None:
        if len(held) != rows:
            raise RecipeError("has another number of rows than times", value=rows)
        step = float(np.median(np.diff(held))) if rows > 1 else 0.0
        if step > 0:
            return held, float(f"{1 / step:.9g}"), True
    rate = setup.rate_hz or RATE_HZ
    return np.arange(rows, dtype=np.float64) / rate, rate, False


def _rays(
    heights: HeightMap, setup: Setup, x_mm: Floats, distance: float
) -> tuple[Floats | None, Floats | None]:
    """Return where each column's ray starts in the sensor frame and its slope dx/dz, or None.

    A reading at height h lies at x + slope h, and h = distance - depth.
    """
    if heights.slope_x is None:
        return None, None
    slope = -heights.slope_x if setup.flip_x else heights.slope_x
    if setup.depth:
        return x_mm, slope
    return x_mm + slope * distance, -slope


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
