"""A path recorded by a robot or an encoder: poses from CSV or HDF5, sampled at the profiles.

Between recorded poses positions are interpolated linearly, orientations by slerp, as between
waypoints; nothing is padded.
"""

import functools
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from files.budget import regular
from files.errors import RecipeError
from files.hdf5_input import has, numbers
from pipeline.motion.trajectory import Array, Trajectory

POSITION: Final = ("x_mm", "y_mm", "z_mm")
QUATERNION: Final = ("qx", "qy", "qz", "qw")
TIME: Final = "time_s"
RIGID: Final = 1e-4
"""How far a rotation may be from orthonormal: 0.1 mm at a metre, as files are rounded."""


def replay(file: str, rate_hz: float, profiles: int) -> Trajectory:
    """Return a pose for each profile from recorded ones.

    With times, profiles are sampled at intervals of 1/rate from the first time. Without times, or
    with exactly as many poses as profiles, each profile has one pose.

    Raises
    ------
    RecipeError
        Where the file can't be read, or ends before the last profile.
    """
    poses, time_s = _read(file)
    if len(poses) == profiles:
        at = np.arange(profiles) / rate_hz if time_s is None else time_s - time_s[0]
        sampled = poses
    elif time_s is None:
        raise RecipeError(
            "as many poses as profiles are needed where the file has no times",
            where=file, value=len(poses), allowed=str(profiles),
        )  # fmt: skip
    else:
        at, along = np.arange(profiles) / rate_hz, time_s - time_s[0]
        if at[-1] > along[-1] * (1 + 1e-9):
            fit = int(np.floor(along[-1] * rate_hz * (1 + 1e-9))) + 1
            raise RecipeError(
                f"the path is too short: {fit} of {profiles} profiles fit on it at {rate_hz:g} Hz",
                where=file,
            )
        sampled = _sampled(poses, along, np.minimum(at, along[-1]))
    length = float(np.linalg.norm(np.diff(sampled[:, :3, 3], axis=0), axis=1).sum())
    return Trajectory(
        poses=sampled, time_s=at, facts={"length_mm": length, "profile_rate_hz": rate_hz}
    )


def _sampled(poses: Array, time_s: Array, at_s: Array) -> Array:
    out = np.tile(np.eye(4), (len(at_s), 1, 1))
    for axis in range(3):
        out[:, axis, 3] = np.interp(at_s, time_s, poses[:, axis, 3])
    turns = poses[:, :3, :3]
    if (turns == turns[0]).all():  # the very same matrix, so that casting can tell
        out[:, :3, :3] = turns[0]
    else:
        out[:, :3, :3] = Slerp(time_s, Rotation.from_matrix(turns))(at_s).as_matrix()
    return out


@functools.lru_cache(maxsize=4)
def _read(file: str) -> tuple[Array, Array | None]:
    """Return poses (n, 4, 4), mm, and times (n,), s, or None."""
    read = _read_csv if Path(file).suffix.lower() == ".csv" else _read_h5
    regular(Path(file))
    try:
        poses, time_s = read(file)
    except RecipeError:
        raise
    except (OSError, ValueError, KeyError, RuntimeError, IndexError) as error:
        why = " ".join(str(error).split())
        raise RecipeError(f"can't be read as poses ({why})", where=file) from None
    if len(poses) < 2 or not np.isfinite(poses).all():
        raise RecipeError("two finite poses at least are needed", where=file, value=len(poses))
    turns = poses[:, :3, :3]
    off = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    off = np.maximum(off, np.abs(np.linalg.det(turns) - 1))
    if off.max() > RIGID:
        raise RecipeError(
            f"pose {int(off.argmax())} isn't rigid", where=file, value=f"{off.max():.2g} off"
        )
    if time_s is not None and not (np.isfinite(time_s).all() and (np.diff(time_s) > 0).all()):
        raise RecipeError("times must rise", where=file)
    return poses, time_s


def _read_csv(file: str) -> tuple[Array, Array | None]:
    table: Any = np.genfromtxt(file, delimiter=",", names=True, dtype=np.float64, encoding="utf-8")
    table = np.atleast_1d(table)
    names = table.dtype.names or ()
    missing = [name for name in (*POSITION, *QUATERNION) if name not in names]
    if missing:
        raise RecipeError(
            "columns are missing", where=file, value=", ".join(missing),
            allowed=", ".join((TIME, *POSITION, *QUATERNION)),
        )  # fmt: skip
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    poses[:, :3, 3] = np.stack([table[name] for name in POSITION], axis=1)
    quaternions = np.stack([table[name] for name in QUATERNION], axis=1)
    length = np.linalg.norm(quaternions, axis=1)
    if not (np.abs(length - 1) <= RIGID).all():
        raise RecipeError("quaternions must have length 1", where=file)
    poses[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    return poses, table[TIME] if TIME in names else None


def _read_h5(file: str) -> tuple[Array, Array | None]:
    with h5py.File(file, "r") as stored:
        poses = numbers(stored, "pose", file)
        time_s = numbers(stored, "time", file) if has(stored, "time") else None
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise RecipeError("/pose has another shape", where=file, value=poses.shape, allowed="n×4×4")
    if time_s is not None and time_s.shape != (len(poses),):
        raise RecipeError("/time has another length than /pose", where=file, value=time_s.shape)
    return poses, time_s
