"""From a height map to a recording: heights up become depth, rows become poses of a straight scan.

The part frame is the instrument's own: x along the columns, y along the rows, z up. The sensor
looks down on it, x along x, so its z is -z and its y = z × x is -y.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sensors.datasheet import Datasheet
from sensors.formats.height_map import Floats, HeightMap
from sensors.recording import Recording
from sensors.typed_yaml import RecipeError


@dataclass(frozen=True, kw_only=True, slots=True)
class Setup:
    """What the user says about how a height map was taken; None = as the file says.

    `travel` is the part's axis along which the rows follow each other.
    """

    name: str
    pitch_x_mm: float | None = None
    pitch_y_mm: float | None = None
    working_distance_mm: float | None = None
    rate_hz: float | None = None
    readings: Literal["height", "depth"] = "height"
    travel: Literal["+y", "-y"] = "+y"
    keep_repeated: bool = False


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Imported:
    """The recording, a sensor that fits it, and how many repeated rows were dropped."""

    recording: Recording
    sensor: Datasheet
    repeated: int


def nice_above(value: float) -> float:
    """Return the smallest of 1, 2, 5 × 10^k that isn't below `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= value * (1 - 1e-12)))


def convert(heights: HeightMap, setup: Setup) -> Imported:
    """Make a recording of a height map; no reading is moved or averaged.

    Raises
    ------
    RecipeError
        Where the pitch is missing, or no reading is left.
    """
    raw = np.where(np.isfinite(heights.readings_mm), heights.readings_mm, np.nan)
    if raw.ndim != 2:
        raise RecipeError("holds no grid of readings", value=raw.shape, allowed="rows × columns")
    if not np.isfinite(raw).any():
        raise RecipeError("holds no reading at all: every point is missing")
    rows, columns = raw.shape
    x_mm = _places(heights.x_mm, heights.pitch_x_mm, setup.pitch_x_mm, columns, "x")
    y_mm = _places(heights.y_mm, heights.pitch_y_mm, setup.pitch_y_mm, rows, "y")
    y_mm = y_mm if setup.travel == "+y" else -y_mm
    time_s = np.arange(rows) / (setup.rate_hz or 1000.0)
    same = _repeats(raw, heights.intensity)
    keep = np.ones(rows, dtype=bool) if setup.keep_repeated else ~same
    if setup.readings == "height":
        top = float(np.nanmax(np.abs(raw)))
        distance = setup.working_distance_mm or nice_above(max(4.0 * top, 1e-6))
        depth = distance - raw
    else:
        distance = setup.working_distance_mm or float(np.nanmedian(raw))
        depth = raw
    low, high = float(np.nanmin(depth)), float(np.nanmax(depth))
    if low <= 0.0:
        raise RecipeError("has readings behind the sensor; give a larger --working-distance-mm")
    poses = np.zeros((rows, 4, 4))
    poses[:] = np.diag([1.0, -1.0, -1.0, 1.0])
    poses[:, 1, 3] = y_mm
    poses[:, 2, 3] = distance
    time_s = time_s[keep] - time_s[keep][0]
    recording = Recording(
        name=setup.name,
        depth_mm=depth[keep],
        poses=poses[keep],
        time_s=time_s,
        intensity=None if heights.intensity is None else heights.intensity[keep],
        x_mm=x_mm,
        comment=heights.note,
    )
    reach = 2.0 * max(abs(low - distance), abs(high - distance))
    sensor = Datasheet(
        name=f"{setup.name}, as imported",
        working_distance_mm=distance,
        z_range_mm=min(nice_above(max(reach, 1e-9)), 1.999 * distance),
        x_fov_mm=float(np.ptp(x_mm)),
        points_per_profile=columns,
        z_resolution_um=1000.0 * (heights.step_mm or 0.0),
        profile_rate_hz=setup.rate_hz or 1000.0,
        columns="even_x",
    )
    return Imported(recording=recording, sensor=sensor, repeated=int((~keep).sum()))


def _places(
    held: Floats | None, held_pitch: float | None, given: float | None, count: int, axis: str
) -> Floats:
    if given is None and held is not None:
        return held
    pitch = given or held_pitch
    if pitch is None:
        raise RecipeError(f"doesn't say its pitch along {axis}; give --pitch-{axis}-mm")
    places = np.arange(count) * pitch
    return places - places.mean() if axis == "x" else places


def _repeats(readings: Floats, intensity: Floats | None) -> NDArray[np.bool_]:
    def equal(a: Floats) -> NDArray[np.bool_]:
        same: NDArray[np.bool_] = ((a[1:] == a[:-1]) | (np.isnan(a[1:]) & np.isnan(a[:-1]))).all(1)
        return same

    same = equal(readings)
    if intensity is not None:
        same &= equal(intensity)
    filled = np.isfinite(readings).any(axis=1)
    return np.concatenate([[False], same & filled[1:]])
