"""What an instrument delivered and how it was taken: recording.h5.

The one place that reads and writes recordings with h5py.
"""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from files.budget import regular
from files.errors import RecipeError
from files.hdf5_input import has, numbers
from files.hdf5_output import created

FORMAT = "profilometer-recording"
VERSION = 1
RIGID_TOLERANCE = 1e-4
SHARD = "flawforge-shard"
FROM_SHARD = "flawforge export DATASET --to recording makes recordings of a dataset"
IMPORT = "flawforge import makes a recording of an instrument's file"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Recording:
    """One scan as delivered; readings stay on the instrument's own grid.

    Attributes
    ----------
    name : str
    depth_mm : (n_profiles, n_points) float64
        Depth in the sensor frame, mm; NaN = missing reading.
    poses : (n_profiles, 4, 4) float64
        Commanded or encoder pose of each profile, sensor to part.
    time_s : (n_profiles,) float64
        Seconds since the first profile.
    intensity : (n_profiles, n_points) float64 or None
        Peak brightness of the laser line, 0 to 1.
    x_mm : (n_points,) float64 or None
        Columns' x with `columns: even_x`, mm.
    start_time_s : float or None
        Start on a clock common to all recordings, seconds.
    ray_x_mm, ray_slope : (n_points,) float64 or None
        Rays of an instrument that doesn't rectify: column j sees x = ray_x + ray_slope * depth.
    import_options : str
        How the recording was made of an instrument's file (JSON), so that it can be repeated.
    """

    name: str
    depth_mm: NDArray[np.float64]
    poses: NDArray[np.float64]
    time_s: NDArray[np.float64]
    intensity: NDArray[np.float64] | None = None
    x_mm: NDArray[np.float64] | None = None
    comment: str = ""
    start_time_s: float | None = None
    ray_x_mm: NDArray[np.float64] | None = None
    ray_slope: NDArray[np.float64] | None = None
    import_options: str = ""

    def __post_init__(self) -> None:
        _check(self)

    @classmethod
    def load(cls, path: str | Path) -> "Recording":
        """Read a recording.h5; without a name in it, the file's stem is its name.

        Raises
        ------
        RecipeError
            Where the file can't be read, isn't a recording, or contradicts itself.
        """
        path = Path(path)
        regular(path)
        try:
            with h5py.File(path, "r") as file:
                kind = _text(file.attrs.get("format"))
                if kind != FORMAT:
                    raise RecipeError(
                        "isn't a recording", where=path, value=kind, allowed=f"format = {FORMAT!r}",
                        hint=FROM_SHARD if kind == SHARD else IMPORT,
                    )  # fmt: skip
                version = int(file.attrs.get("version", VERSION))
                if version > VERSION:
                    raise RecipeError(
                        "is of a later version", where=path, value=version, allowed=f"{VERSION}"
                    )
                needed = ("depth", "pose", "time")
                others = ("intensity", "x", "ray_x", "ray_slope")
                wanted = (*needed, *(key for key in others if has(file, key)))
                arrays = {key: numbers(file, key, path) for key in wanted}
                start = file.attrs.get("start_time_s")
                return cls(
                    name=_text(file.attrs.get("name")) or path.stem,
                    depth_mm=arrays["depth"],
                    poses=arrays["pose"],
                    time_s=arrays["time"],
                    intensity=arrays.get("intensity"),
                    x_mm=arrays.get("x"),
                    comment=_text(file.attrs.get("comment")),
                    start_time_s=None if start is None else float(start),
                    ray_x_mm=arrays.get("ray_x"),
                    ray_slope=arrays.get("ray_slope"),
                    import_options=_text(file.attrs.get("import_options")),
                )
        except OSError as error:
            reason, hint = error.strerror, None
            if reason is None:
                reason, hint = "not an HDF5 file, or damaged", IMPORT
            raise RecipeError(f"can't be read ({reason})", where=path, hint=hint) from None
        except (TypeError, ValueError, OverflowError) as error:
            if isinstance(error, RecipeError):
                text = str(error)
                if text.startswith(str(path)):
                    raise
                raise RecipeError(text, where=path) from None
            raise RecipeError(f"has attributes that can't be read ({error})", where=path) from None
        except (KeyError, RuntimeError, IndexError) as error:  # of damaged HDF5
            words = " ".join(str(error).split())
            raise RecipeError(f"is damaged ({words})", where=path) from None

    def save(self, path: str | Path) -> None:
        """Write the form that `load` reads; depth and intensity as float32."""
        with created(path) as file:
            file.attrs["format"] = FORMAT
            file.attrs["version"] = VERSION
            file.attrs["name"] = self.name
            file.attrs["comment"] = self.comment
            if self.start_time_s is not None:
                file.attrs["start_time_s"] = self.start_time_s
            packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True}
            file.create_dataset("depth", data=self.depth_mm.astype(np.float32), **packed)
            if self.intensity is not None:
                file.create_dataset("intensity", data=self.intensity.astype(np.float32), **packed)
            file.create_dataset("pose", data=self.poses)
            file.create_dataset("time", data=self.time_s)
            if self.x_mm is not None:
                file.create_dataset("x", data=self.x_mm)
            if self.ray_x_mm is not None and self.ray_slope is not None:
                file.create_dataset("ray_x", data=self.ray_x_mm)
                file.create_dataset("ray_slope", data=self.ray_slope)
            if self.import_options:
                file.attrs["import_options"] = self.import_options


def repeated_rows(depth_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark profiles that repeat the one before, reading for reading: they measured nothing.

    A profile whose readings are all missing or all equal (a blank, or a plane seen by a coarse
    scale) may equal its neighbour honestly and isn't marked.
    """
    before, after = depth_mm[:-1], depth_mm[1:]
    same = ((before == after) | (np.isnan(before) & np.isnan(after))).all(axis=1)
    finite = np.isfinite(depth_mm)
    low = np.where(finite, depth_mm, np.inf).min(axis=1)
    high = np.where(finite, depth_mm, -np.inf).max(axis=1)
    structured = (finite.sum(axis=1) >= 8) & (high > low)
    return np.concatenate([[False], same & structured[1:]])


def _check(recording: Recording) -> None:
    depth = recording.depth_mm
    if depth.ndim != 2 or depth.shape[0] < 1 or depth.shape[1] < 2:
        raise RecipeError("/depth needs at least one profile of 2 points", value=depth.shape)
    if not np.isfinite(depth).any():
        raise RecipeError("/depth holds no reading at all: every point is NaN")
    if np.isinf(depth).any():
        raise RecipeError("/depth holds infinite readings; a missing return is NaN")
    count, points = depth.shape
    for key, array, shape in (
        ("pose", recording.poses, (count, 4, 4)),
        ("time", recording.time_s, (count,)),
        ("intensity", recording.intensity, (count, points)),
        ("x", recording.x_mm, (points,)),
        ("ray_x", recording.ray_x_mm, (points,)),
        ("ray_slope", recording.ray_slope, (points,)),
    ):
        if array is not None and array.shape != shape:
            raise RecipeError(
                f"/{key} doesn't fit /depth {depth.shape}", value=array.shape, allowed=f"{shape}"
            )
    if not np.isfinite(recording.time_s).all() or (np.diff(recording.time_s) < 0).any():
        raise RecipeError("/time must be finite and never run backwards")
    if recording.x_mm is not None:
        step = np.diff(recording.x_mm)
        if not np.isfinite(recording.x_mm).all() or not ((step > 0).all() or (step < 0).all()):
            raise RecipeError("/x must be finite and strictly monotone")
    rays = (recording.ray_x_mm, recording.ray_slope)
    if (rays[0] is None) != (rays[1] is None):
        raise RecipeError("/ray_x and /ray_slope go together")
    if any(ray is not None and not np.isfinite(ray).all() for ray in rays):
        raise RecipeError("/ray_x and /ray_slope must be finite")
    if recording.start_time_s is not None and not np.isfinite(recording.start_time_s):
        raise RecipeError("start_time_s isn't a number", value=recording.start_time_s)
    _check_rigid(recording.poses)


def _check_rigid(poses: NDArray[np.float64]) -> None:
    if not np.isfinite(poses).all():
        raise RecipeError("/pose holds values that aren't finite")
    rotation = poses[:, :3, :3]
    with np.errstate(all="ignore"):  # numbers near the largest: off is infinite then, or NaN
        gram = rotation @ rotation.transpose(0, 2, 1)
        off = np.abs(gram - np.eye(3)).max(axis=(1, 2))
        turned = np.linalg.det(rotation) < 0
    last = np.abs(poses[:, 3] - np.array([0.0, 0.0, 0.0, 1.0])).max(axis=1)
    skewed = ~(off <= RIGID_TOLERANCE)
    bad = skewed | turned | (last > RIGID_TOLERANCE)
    if bad.any():
        row = int(np.argmax(bad))
        if turned[row]:
            why = "it mirrors"
        elif skewed[row]:
            why = f"its rotation is off by {off[row]:.2g}"
        else:
            why = "its last row isn't 0 0 0 1"
        raise RecipeError(f"/pose of profile {row} isn't rigid ({why})")


def _text(value: object) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return "" if value is None else str(value)
