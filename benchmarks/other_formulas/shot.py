"""One recording in the making: geometry, and the fields that formulas change."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from benchmarks.other_formulas.instrument import MISSING_SHARE, Instrument, Scan
from benchmarks.other_formulas.speckle import Noise, field
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene

Floats = NDArray[np.float64]
Draw = Callable[[tuple[int, int], np.random.Generator], Floats]
"""Sizes of outliers in mm for a shape (n, m)."""
Firmware = Callable[[Floats, np.random.Generator], Floats]
"""What the instrument does to its readings before it delivers them."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class View:
    """What a scan meets: exact geometry, computed once and shared by all changes of a shot."""

    scene: Scene
    instrument: Instrument
    scan: Scan
    rays: Laser | None = None

    @cached_property
    def laser(self) -> Laser:
        """Rays of a profile: those of the file where none are given."""
        return self.rays or Laser.from_datasheet(self.instrument.sheet)

    def cast(self, dx: Floats | float = 0.0, dy: Floats | float = 0.0) -> Floats:
        """Depth (n, m) seen from places shifted in the sensor's frame by (dx, dy) mm."""
        poses = self.scan.true_poses.copy()
        n = len(poses)
        shift = np.stack(np.broadcast_arrays(dx, dy, 0.0, np.zeros(n))[:3], -1)
        poses[:, :3, 3] += np.einsum("nij,nj->ni", poses[:, :3, :3], shift)
        return self.seen_from(poses)

    def seen_from(self, poses: Floats) -> Floats:
        """Depth (n, m) from poses, NaN out of range."""
        depth = self.scene.cast(self.laser, poses).depth_mm
        sheet = self.instrument.sheet
        with np.errstate(invalid="ignore"):
            valid = (depth >= sheet.depth_min_mm) & (depth <= sheet.depth_max_mm)
        return np.where(valid, depth, np.nan)

    @cached_property
    def _hits(self) -> tuple[Floats, Floats]:
        hits = self.scene.cast(self.laser, self.scan.true_poses)
        rotation = self.scan.true_poses[:, :3, :3]
        normal = np.einsum("nji,nmj->nmi", rotation, self.scene.normals[hits.triangle])
        return hits.depth_mm, normal

    @cached_property
    def depth(self) -> Floats:
        """Depth (n, m), NaN out of range."""
        return self.cast()

    @property
    def shape(self) -> tuple[int, int]:
        """Profiles and columns."""
        n, m = self.depth.shape
        return n, m

    @cached_property
    def x(self) -> Floats:
        """Place along the line, sensor frame, mm."""
        return np.asarray(self.laser.x_mm + np.nan_to_num(self.depth) * self.laser.slope_x)

    @cached_property
    def slope_y(self) -> Floats:
        """Slope p = dz/dy along the travel."""
        n = self._hits[1]
        return np.asarray(-n[..., 1] / np.minimum(n[..., 2], -1e-3))

    @cached_property
    def slope_x(self) -> Floats:
        """Slope q = dz/dx along the line."""
        n = self._hits[1]
        return np.asarray(-n[..., 0] / np.minimum(n[..., 2], -1e-3))

    @cached_property
    def incidence(self) -> Floats:
        """Angle between the normal and the laser's rays, rad."""
        ray = np.stack([self.laser.slope_x, 0 * self.laser.slope_x, 1 + 0 * self.laser.slope_x], -1)
        ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
        return np.arccos(np.clip(-(self._hits[1] * ray).sum(-1), 0, 1))

    @cached_property
    def points(self) -> Floats:
        """Where the readings lie in the part's frame, mm, (n, m, 3)."""
        local = np.stack([self.x, 0 * self.x, np.nan_to_num(self.depth)], -1)
        pose = self.scan.true_poses
        return np.einsum("nij,nmj->nmi", pose[:, :3, :3], local) + pose[:, None, :3, 3]

    @cached_property
    def normal(self) -> Floats:
        """Outward normals in the sensor's frame, (n, m, 3)."""
        return self._hits[1]

    @cached_property
    def to_camera(self) -> Floats:
        """Unit vectors from the readings towards the camera, sensor frame, (n, m, 3)."""
        way = np.stack(
            [-self.x, np.full_like(self.x, self.camera_y_mm), -np.nan_to_num(self.depth, nan=1e3)],
            -1,
        )
        return np.asarray(way / np.linalg.norm(way, axis=-1, keepdims=True))

    @property
    def camera_y_mm(self) -> float:
        """Place of the camera along the travel."""
        return self.instrument.sheet.camera_offset_mm

    @cached_property
    def cot(self) -> Floats:
        """κ cot θ at each reading: depth read for light displaced by 1 mm along the travel."""
        return np.asarray(np.nan_to_num(self.depth) / self.camera_y_mm)

    @cached_property
    def edge(self) -> NDArray[np.bool_]:
        """Readings within a pitch of a step of more than 0.3 mm beyond the local slope."""
        wide = [self.cast(dx, dy) for dx, dy in ((0.25, 0), (-0.25, 0), (0, 0.3), (0, -0.3))]
        with np.errstate(invalid="ignore"):
            jump = np.max([np.abs(w - self.depth) for w in wide], axis=0)
        return np.asarray(~(jump < 0.3))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Shot:
    """A recording's law as formulas have made it; every change is a new shot.

    Attributes
    ----------
    view : exact geometry
    index : number of the recording
    mean : (n, m) mm, NaN where nothing comes back
    scale : (n, m) or 1, factor on the noise's standard deviation
    noise : its correlation
    p_missing : probability that a reading is lost
    clump : kernel of the patches in which readings are lost, None: each for itself
    p_outlier, outlier : share of outliers and their sizes
    firmware : what is done to the readings at last
    intensity : (n, m) brightness, where the instrument records it
    mounting : (4, 4) how the sensor sits in its own frame, None: as it should
    """

    view: View
    index: int
    mean: Floats
    noise: Noise
    scale: Floats | float = 1.0
    p_missing: Floats | float = MISSING_SHARE
    clump: Floats | None = None
    p_outlier: Floats | float = 0.0
    outlier: Draw | None = None
    firmware: Firmware | None = None
    intensity: Floats | None = None
    mounting: Floats | None = None

    def plus(self, change: Floats) -> "Shot":
        """Add a change of the mean, mm."""
        return replace(self, mean=self.mean + change)

    def sample(self, rng: np.random.Generator) -> Floats:
        """Draw the readings, mm."""
        sheet, sd = self.view.instrument.sheet, self.view.instrument.noise_mm
        shape = self.view.shape
        depth = self.mean + sd * self.scale * self.noise.draw(shape, rng)
        if self.outlier is not None:
            hit = rng.random(shape) < self.p_outlier
            depth = np.where(hit, depth + self.outlier(shape, rng), depth)
        lot = rng.random(shape)
        if self.clump is not None:
            lot = norm.cdf(field(self.clump, shape, rng))
        depth = np.where(lot < self.p_missing, np.nan, depth)
        if self.firmware is not None:
            depth = self.firmware(depth, rng)
        with np.errstate(invalid="ignore"):
            inside = (depth >= sheet.depth_min_mm) & (depth <= sheet.depth_max_mm)
        depth = np.where(inside, depth, np.nan)
        return np.asarray(np.round(depth / sheet.step_mm) * sheet.step_mm)


def wobble(view: View) -> Floats:
    """Small smooth error of a good instrument over (x, z), mm."""
    sheet = view.instrument.sheet
    u = 2 * view.x / sheet.x_fov_mm
    v = (np.nan_to_num(view.depth, nan=sheet.working_distance_mm) - sheet.working_distance_mm) / 8.0
    return np.asarray(
        np.polynomial.legendre.legval2d(
            np.clip(u, -1, 1), np.clip(v, -1, 1), view.instrument.wobble
        )
    )
