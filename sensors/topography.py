"""Readings on an even grid from a user's file: recording, table of numbers, image or array."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sensors.datasheet import Datasheet
from sensors.recording import Recording, repeated_rows
from sensors.typed_yaml import RecipeError

Floats = NDArray[np.float64]

UNITS_MM = {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "nm": 1e-6, "m": 1e3}

KINDS = ".h5, .csv, .txt, .npy, .tif or .tiff"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Topography:
    """Readings in mm, one row a profile, NaN where missing, and their pitch.

    `repeated` counts profiles that repeated the one before and were dropped.
    """

    name: str
    readings_mm: Floats
    pitch_x_mm: float
    pitch_y_mm: float
    repeated: int = 0


def load_topography(
    path: str | Path,
    *,
    unit: str | None = None,
    pitch_x_mm: float | None = None,
    pitch_y_mm: float | None = None,
    sensor: Datasheet | None = None,
) -> Topography:
    """Read a recording.h5, a CSV, TIFF or NPY grid, or a CSV profile of two columns.

    Parameters
    ----------
    path : path
        The file. A CSV whose two columns are positions and heights is one profile; names such as
        `x_mm,z_um` in its first line give the units.
    unit : str, optional
        Unit of the readings in a CSV, TIFF or NPY (mm, um, nm, m); mm where nothing else is said.
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
    if unit is not None and unit not in UNITS_MM:
        raise RecipeError("unknown unit", value=unit, allowed=", ".join(UNITS_MM))
    if kind in (".h5", ".hdf5"):
        recording = Recording.load(path)
        readings, held = recording.depth_mm, _recording_pitch(recording, sensor)
    elif kind in (".csv", ".txt"):
        readings, held = _read_csv(path, unit)
    elif kind in (".npy", ".tif", ".tiff"):
        raw = _read_npy(path) if kind == ".npy" else _read_tiff(path)
        readings = np.asarray(raw, dtype=np.float64) * UNITS_MM[unit or "mm"]
    else:
        raise RecipeError("isn't a file of readings", where=path, allowed=KINDS)
    readings = np.where(np.isfinite(readings), readings, np.nan)
    if readings.ndim == 1:
        readings = readings[None, :]
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
            "doesn't say how far apart its points are; give --pitch-x-mm"
            + (" (or --sensor)" if kind in (".h5", ".hdf5") else ""),
            where=path,
        )
    return Topography(
        name=path.stem,
        readings_mm=readings[~repeated],
        pitch_x_mm=float(pitch_x),
        pitch_y_mm=float(pitch_y_mm or held[1] or pitch_x),
        repeated=int(repeated.sum()),
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
    if x_mm is None and sensor is not None:
        points = recording.depth_mm.shape[1]
        half = sensor.fov_rad / 2.0
        if sensor.columns == "even_angle":
            slope = np.tan(np.linspace(-half, half, points))
            x_mm = np.nanmedian(recording.depth_mm) * slope
        else:
            x_mm = np.linspace(-sensor.x_fov_mm / 2.0, sensor.x_fov_mm / 2.0, points)
    pitch_x = None if x_mm is None else float(np.median(np.abs(np.diff(x_mm))))
    steps = np.linalg.norm(np.diff(recording.poses[:, :3, 3], axis=0), axis=1)
    pitch_y = float(np.median(steps))
    return pitch_x, pitch_y if pitch_y > 0.0 else None


def _read_csv(path: Path, unit: str | None) -> tuple[Floats, tuple[float | None, float | None]]:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise RecipeError(f"can't be read ({error.strerror})", where=path) from None
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise RecipeError("is empty", where=path)
    separator = next((s for s in (";", "\t", ",") if s in lines[-1]), None)
    names: list[str] = []
    first = lines[0].lstrip("#").strip()
    if re.search(r"[A-Za-z]{1,}", re.sub(r"(?i)\bnan\b|\d[eE][+-]?\d", "", first)):
        names = [name.strip() for name in first.split(separator)]
        lines = lines[1:]
    rows = []
    for number, line in enumerate(lines, start=2 if names else 1):
        try:
            cells = line.split(separator)
            rows.append([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError:
            raise RecipeError("isn't a row of numbers", where=f"{path}:{number}") from None
    if len({len(row) for row in rows}) != 1:
        raise RecipeError("has rows of different lengths", where=path)
    table = np.array(rows, dtype=np.float64)
    if table.shape[1] == 2 and table.shape[0] >= 16 and (np.diff(table[:, 0]) > 0.0).all():
        scales = [_unit_in(name) for name in names] if len(names) == 2 else [None, None]
        x_mm = table[:, 0] * (scales[0] or UNITS_MM["mm"])
        z_mm = table[:, 1] * (UNITS_MM[unit] if unit else scales[1] or UNITS_MM["mm"])
        steps = np.diff(x_mm)
        if float(np.ptp(steps)) > 0.01 * float(np.median(steps)):
            raise RecipeError("has points that aren't evenly spaced", where=path)
        return z_mm[None, :], (float(np.median(steps)), None)
    return table * UNITS_MM[unit or "mm"], (None, None)


def _unit_in(name: str) -> float | None:
    found = re.search(r"(?:_|\[|\(|\s)(mm|um|µm|nm|m)[\])]?$", name.strip())
    return UNITS_MM[found.group(1)] if found else None


def _read_npy(path: Path) -> NDArray[np.generic]:
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise RecipeError(f"isn't an array of numbers ({error})", where=path) from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        raise RecipeError("isn't an array of numbers", where=path)
    return array


def _read_tiff(path: Path) -> NDArray[np.generic]:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            array: NDArray[np.generic] = np.array(image)
    except (OSError, UnidentifiedImageError) as error:
        raise RecipeError(f"isn't a TIFF image of heights ({error})", where=path) from None
    return array
