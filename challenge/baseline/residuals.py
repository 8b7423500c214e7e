"""Residuals of what a stranger gets against the nominal part, cast at the commanded poses."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import yaml
from numba import njit
from numpy.typing import NDArray

from challenge.cases.files import read_stl
from challenge.instrument.rays import Tree, nearest, plant

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Residuals:
    """One recording against the mesh.

    Attributes
    ----------
    depth_mm, nominal_mm, brightness : (n, m)
        Read, cast, and brightness; NaN where missing.
    x_mm : (m,) of the columns at the working distance
    from_middle_mm : (n, m) nominal depth from the working distance
    clock_s : (n,) of the profiles
    """

    depth_mm: Floats
    nominal_mm: Floats
    brightness: Floats
    x_mm: Floats
    from_middle_mm: Floats
    clock_s: Floats

    @property
    def rest_mm(self) -> Floats:
        """Read minus nominal depth."""
        return self.depth_mm - self.nominal_mm


@njit(cache=True)
def _cast(tree: Tree, pose: Floats, x: Floats, slope: Floats) -> Floats:
    """Depth (n, m) along rays (slope, 0, 1) from (x, 0, 0) in the sensor's frame."""
    out = np.full((pose.shape[0], x.size), np.nan)
    for i in range(pose.shape[0]):
        p = pose[i]
        for j in range(x.size):
            origin = (
                p[0, 3] + p[0, 0] * x[j], p[1, 3] + p[1, 0] * x[j], p[2, 3] + p[2, 0] * x[j]
            )  # fmt: skip
            direction = (
                p[0, 0] * slope[j] + p[0, 2], p[1, 0] * slope[j] + p[1, 2],
                p[2, 0] * slope[j] + p[2, 2],
            )  # fmt: skip
            far, which = nearest(tree, origin, direction, 1e-3, 1e9, False)
            if which >= 0:
                out[i, j] = far
    return out


def residuals(recording: Path, tree: Tree, sheet: dict[str, Any]) -> Residuals:
    """Read one recording and cast its rays.

    Parameters
    ----------
    tree : of the part
    sheet : content of sensor.yaml
    """
    with h5py.File(recording) as file:
        depth = np.asarray(file["depth"], np.float64)
        bright = np.asarray(file["intensity"], np.float64)
        pose, time = np.asarray(file["pose"], np.float64), np.asarray(file["time"], np.float64)
        start = float(file.attrs["start_time_s"])
        x = np.asarray(file["x"], np.float64) if "x" in file else None
    distance, half = float(sheet["working_distance_mm"]), float(sheet["x_fov_mm"]) / 2
    if x is None:  # a fan of even angles
        slope = np.tan(np.linspace(-1, 1, depth.shape[1]) * np.arctan(half / distance))
        from_x, seen = np.zeros_like(slope), slope * distance
    else:
        slope, from_x, seen = np.zeros_like(x), x, x
    nominal = _cast(tree, pose, from_x, slope)
    return Residuals(depth_mm=depth, nominal_mm=nominal, brightness=bright, x_mm=seen,
                     from_middle_mm=nominal - distance, clock_s=start + time)  # fmt: skip


def of_case(folder: Path) -> tuple[list[Residuals], list[Residuals]]:
    """Residuals of a case's recordings, and of its baselines, in the order of their names."""
    sheet = yaml.safe_load((folder / "sensor.yaml").read_text())
    solid = read_stl(folder / "part.stl")
    tree = plant(solid.vertices_mm, solid.faces)

    def those(pattern: str) -> list[Residuals]:
        return [residuals(file, tree, sheet) for file in sorted(folder.glob(pattern))]

    return those("[a-z].h5"), those("base-*.h5")
