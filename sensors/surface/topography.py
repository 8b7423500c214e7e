"""Readings on an even grid from a user's file: a recording, or what an instrument wrote."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.datasheet import Datasheet
from sensors.formats import READERS, read_height_map
from sensors.recording import Recording, repeated_rows

Floats = NDArray[np.float64]

KINDS = ", ".join([".h5", *READERS])


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Topography:
    """Readings in mm, one row a profile, NaN where missing, and their pitch.

    `repeated` counts profiles that repeated the one before and were dropped; `slope_x` and
    `slope_y` are those of a recording's best plane in the sensor's frame, 0 without poses.
    """

    name: str
    readings_mm: Floats
    pitch_x_mm: float
    pitch_y_mm: float
    repeated: int = 0
    slope_x: float = 0.0
    slope_y: float = 0.0


def load_topography(
    path: str | Path,
    *,
    unit: str | None = None,
    pitch_x_mm: float | None = None,
    pitch_y_mm: float | None = None,
    sensor: Datasheet | None = None,
) -> Topography:
    """Read a recording.h5, or a file of one of the instruments' formats (`sensors/formats`).

    Parameters
    ----------
    path : path
        The file. A CSV whose two columns are positions and heights is one profile; names such as
        `x_mm,z_um` in its first line give the units.
    unit : str, optional
        Unit of the readings in a file that isn't a recording (mm, um, nm, m); the file's own, or
        mm, without a stated unit.
    pitch_x_mm, pitch_y_mm : float, optional
        Pitch in mm, where the file doesn't hold it or holds it wrong.
    sensor : Datasheet, optional
        Gives a recording's pitch along a fan of rays (`columns: even_angle`).

    Raises
    ------
    RecipeError
        Where the file can't be read, holds no grid of numbers, or the pitch is missing.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if not path.is_file():
        raise RecipeError("no such file", where=path)
    held: tuple[float | None, float | None] = (None, None)
    slopes = 0.0, 0.0
    if kind in (".h5", ".hdf5"):
        recording = Recording.load(path)
        readings, held = recording.depth_mm, _recording_pitch(recording, sensor)
        slopes = _slopes(recording, held[0])
    elif kind in READERS:
        heights = read_height_map(path, unit)
        readings = heights.readings_mm
        held = _even_pitch(heights.x_mm, path), _even_pitch(heights.y_mm, path)
    else:
        raise RecipeError("isn't a file of readings", where=path, allowed=KINDS)
    readings = np.where(np.isfinite(readings), readings, np.nan)
    if readings.ndim != 2 or readings.shape[1] < 16:
        raise RecipeError(
            "holds no grid of readings",
            where=path,
            value=readings.shape,
            allowed="profiles × at least 16 points",
        )
    repeated = repeated_rows(readings) if len(readings) > 1 else np.zeros(1, dtype=bool)
    pitch_x = pitch_x_mm or held[0]
    if pitch_x is None or not pitch_x > 0.0:
        raise RecipeError(
            "states no pitch of its points; give --pitch-x-mm"
            + (" (or --sensor)" if kind in (".h5", ".hdf5") else ""),
            where=path,
        )
    return Topography(
        name=path.stem,
        readings_mm=readings[~repeated],
        pitch_x_mm=float(pitch_x),
        pitch_y_mm=float(pitch_y_mm or held[1] or pitch_x),
        repeated=int(repeated.sum()),
        slope_x=slopes[0],
        slope_y=slopes[1],
    )


def resolution_of(readings_mm: Floats) -> float:
    """Guess the step ΔZ of rounded readings, mm; 0 where they don't look rounded.

    The step is the smallest difference between two readings that divides nearly all others.
    """
    levels = np.unique(readings_mm[np.isfinite(readings_mm)])
    if levels.size < 3 or levels.size > 0.5 * np.isfinite(readings_mm).sum():
        return 0.0
    steps = np.diff(levels)
    noise = 4.0 * float(np.finfo(np.float32).eps) * float(np.max(np.abs(levels)))
    steps = steps[steps > noise]
    if steps.size == 0:
        return 0.0
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    whole = steps / step
    off = np.abs(whole - np.rint(whole)) * step
    return step if float(np.mean(off <= 0.05 * step + noise)) > 0.95 else 0.0


def _recording_pitch(
    recording: Recording, sensor: Datasheet | None
) -> tuple[float | None, float | None]:
    x_mm = recording.x_mm
    if recording.ray_x_mm is not None and recording.ray_slope is not None:
        x_mm = recording.ray_x_mm + np.nanmedian(recording.depth_mm) * recording.ray_slope
    elif x_mm is None and sensor is not None:
        points = recording.depth_mm.shape[1]
        half = sensor.fov_rad / 2.0
        if sensor.columns == "even_angle":
            slope = np.tan(np.linspace(-half, half, points))
            x_mm = np.nanmedian(recording.depth_mm) * slope
        else:
            x_mm = np.linspace(-sensor.x_fov_mm / 2.0, sensor.x_fov_mm / 2.0, points)
    pitch_x = None if x_mm is None else float(np.median(np.abs(np.diff(x_mm))))
    steps = np.linalg.norm(np.diff(recording.poses[:, :3, 3], axis=0), axis=1)
    pitch_y = float(np.median(steps)) if steps.size else 0.0
    return pitch_x, pitch_y if pitch_y > 0.0 else None


def _slopes(recording: Recording, pitch_x_mm: float | None) -> tuple[float, float]:
    """Depth slopes dz/dx and dz/dy of a straight recording's best plane, sensor frame."""
    depth, poses = np.asarray(recording.depth_mm, np.float64), recording.poses
    way = (poses[:, :3, 3] - poses[0, :3, 3]) @ poses[0, :3, :3]
    along = np.median(np.diff(way, axis=0), axis=0) if len(way) > 1 else np.zeros(3)
    seen = np.isfinite(depth)
    if pitch_x_mm is None or not abs(along[1]) > 0.0 or seen.sum() < 100:
        return 0.0, 0.0
    row, column = np.nonzero(seen)
    y, z = way[row, 1], depth[seen] + way[row, 2]
    design = np.stack([np.ones(row.size), column * pitch_x_mm, y], 1)
    found = np.linalg.lstsq(design, z, rcond=None)[0]
    return float(found[1]), float(found[2])


def _even_pitch(places_mm: Floats | None, path: Path) -> float | None:
    if places_mm is None or places_mm.size < 2:
        return None
    steps = np.abs(np.diff(places_mm))
    if float(np.ptp(steps)) > 0.01 * float(np.median(steps)):
        raise RecipeError("has points that aren't evenly spaced", where=path)
    return float(np.median(steps))
