"""The shuffled baseline: the same residuals where their covariates no longer belong to them.

Blocks of each recording's residual against the maker's file change places at random, brightness
with them, and the recordings exchange their times. Size, tails and correlation of what is wrong
stay; its tie to place, slope, row, column and time is gone. A diagnosis that names effects from
their size alone would name them still.
"""

from pathlib import Path as FilePath
from typing import Any

import h5py
import numpy as np
import yaml
from numpy.typing import NDArray

from challenge.baseline.residuals import residuals
from challenge.cases.files import read_stl
from challenge.cases.stated import Rays, stated
from challenge.instrument.camera import Camera
from challenge.instrument.instrument import Path, Solid
from challenge.instrument.rays import plant

SHUFFLED = "answers-shuffled"
_BLOCK = 16


def camera_of(sheet: dict[str, Any]) -> Camera:
    """Geometry of the camera as the maker's file has it."""
    distance = float(sheet["working_distance_mm"])
    return Camera(
        working_distance_mm=distance,
        triangulation_rad=float(np.radians(sheet["triangulation_angle_deg"])),
        side=1 if sheet["camera_side"] == "+y" else -1,
        columns=int(sheet["points_per_profile"]),
        fov_rad=float(2 * np.arctan(sheet["x_fov_mm"] / 2 / distance)),
        rows=int(sheet["camera_rows"]),
        row_pitch_mm=0.05,
    )


def shuffle(folder: FilePath, rng: np.random.Generator) -> None:
    """Shuffle the recordings of a case in place.

    Parameters
    ----------
    folder
        A copy of what a stranger gets.
    """
    sheet = yaml.safe_load((folder / "sensor.yaml").read_text())
    solid = read_stl(folder / "part.stl")
    tree = plant(solid.vertices_mm, solid.faces)
    recordings = sorted(folder.glob("[a-z].h5"))
    starts = []
    for file in recordings:
        # a rectifying instrument's file has its levels in the mesh alone
        rectified = sheet["columns"] == "even_x"
        said = residuals(file, tree, sheet).nominal_mm if rectified else _said(file, solid, sheet)
        with h5py.File(file, "r+") as recording:
            depth = np.asarray(recording["depth"], np.float64)
            order = rng.permutation(np.prod([size // _BLOCK for size in depth.shape]))
            moved = moved_blocks(depth - said, order)
            recording["depth"][...] = (said + moved).astype(np.float32)
            recording["intensity"][...] = moved_blocks(
                np.asarray(recording["intensity"], np.float64), order
            ).astype(np.float32)
            starts.append(float(recording.attrs["start_time_s"]))
    for file, start in zip(recordings, rng.permutation(starts), strict=True):
        with h5py.File(file, "r+") as recording:
            recording.attrs["start_time_s"] = start


def _said(file: FilePath, solid: Solid, sheet: dict[str, Any]) -> NDArray[np.float64]:
    """Depth (n, m) that the file of an instrument of the first family predicts."""
    with h5py.File(file) as recording:
        pose = recording["pose"][:]
    step = (pose[-1, :3, 3] - pose[0, :3, 3]) / max(len(pose) - 1, 1)
    along = float(step @ pose[0, :3, 1])
    path = Path(
        start=pose[0], direction=1 if along > 0 else -1, profiles=len(pose),
        pitch_mm=abs(along), rate_hz=1.0, start_s=0.0,
    )  # fmt: skip
    rays = Rays(solid, path, np.eye(4), camera_of(sheet), float(sheet["z_range_mm"]))
    return np.asarray(stated(rays, sheet["effects"]).depth_mm)


def moved_blocks(values: NDArray[np.float64], order: NDArray[np.int64]) -> NDArray[np.float64]:
    """Exchange blocks of 16 x 16; the rest at the ends stays."""
    rows, columns = (size // _BLOCK for size in values.shape)
    out = values.copy()
    inner = values[: rows * _BLOCK, : columns * _BLOCK]
    blocks = inner.reshape(rows, _BLOCK, columns, _BLOCK).swapaxes(1, 2)
    mixed = blocks.reshape(-1, _BLOCK, _BLOCK)[order].reshape(rows, columns, _BLOCK, _BLOCK)
    out[: rows * _BLOCK, : columns * _BLOCK] = mixed.swapaxes(1, 2).reshape(inner.shape)
    return out
