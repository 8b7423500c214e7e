"""The whole instrument: sheet, camera, detector and calibration, scanning a part."""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from challenge.instrument.bounce import second_light
from challenge.instrument.calibration import Calibration, CalibrationPlan, fit
from challenge.instrument.camera import Camera
from challenge.instrument.frames import Faults, expose
from challenge.instrument.motion import Motion
from challenge.instrument.optical_surface import OpticalSurface
from challenge.instrument.peaks import PeakFinder
from challenge.instrument.rays import Tree, plant
from challenge.instrument.sheet import LaserSheet
from challenge.instrument.stripes import Cast, lay_out


@dataclass(frozen=True, kw_only=True, slots=True)
class Solid:
    """A part as it really is: vertices (V, 3) mm, faces (F, 3), in the part frame."""

    vertices_mm: NDArray[np.float64]
    faces: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Path:
    """A commanded straight scan.

    Attributes
    ----------
    start : (4, 4)
        Commanded pose of the first profile, sensor -> part.
    direction : int
        +1 travels along the sensor's own +y.
    profiles, pitch_mm, rate_hz
        Profiles, their distance and how many a second.
    start_s
        First profile on the instrument's clock.
    """

    start: NDArray[np.float64]
    direction: int
    profiles: int
    pitch_mm: float
    rate_hz: float
    start_s: float

    def poses(self) -> NDArray[np.float64]:
        """Commanded poses, (profiles, 4, 4)."""
        poses = np.repeat(self.start[None], self.profiles, axis=0)
        along = self.direction * self.pitch_mm * np.arange(self.profiles)
        poses[:, :3, 3] += along[:, None] * self.start[:3, 1]
        return poses


# The rays last cast, kept by a caller that scans many specimens of one solid in one pose.
Casts = dict[tuple[bytes, float, float, float], tuple[Tree, Cast]]


@dataclass(frozen=True, kw_only=True, slots=True)
class Instrument:
    """An instrument on its stage; every difference between two instruments is physical.

    Attributes
    ----------
    z_range_mm, step_mm
        Working range and the count in which depth is delivered.
    calibration
        None until `calibrated` has been called.
    """

    sheet: LaserSheet
    camera: Camera
    finder: PeakFinder
    faults: Faults
    motion: Motion
    plan: CalibrationPlan
    z_range_mm: float
    step_mm: float
    calibration: Calibration | None = None

    def rows_of(
        self,
        solid: Solid,
        surface: OpticalSurface,
        path: Path,
        rng: np.random.Generator,
        *,
        specimen: int,
        misplaced: NDArray[np.float64] | None = None,
        keep: int = -1,
        moving: bool = True,
        casts: Casts | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Scan a part and deliver chip rows, brightness and one frame; see `scan`."""
        motion = self.motion if moving else Motion()
        true_start = path.start @ motion.mounting()
        if misplaced is not None:
            true_start = misplaced @ true_start
        begin = np.arange(path.profiles) / path.rate_hz
        speed = path.pitch_mm * path.rate_hz
        parts = max(1, ceil(speed * self.sheet.exposure_s / (0.6 * self.sheet.waist_mm)))
        within = (np.arange(parts) + 0.5) / parts * self.sheet.exposure_s
        time = begin[:, None] + within
        where = motion.where(
            time,
            time * speed,
            direction=path.direction,
            start_s=path.start_s,
            phases_rad=rng.uniform(0, 2 * np.pi, 2),
        )
        # the commanded path runs along the commanded y, which the mounting may have turned
        travel = where[..., 1:2] * motion.mounting()[1, :3]
        where = travel + where * np.array([1.0, 0.0, 1.0])
        wide = 3.6 * float(self.sheet.sigma_mm(np.array(self._edge_depths())).max())
        first, last = float(where[..., 1].min()) - wide, float(where[..., 1].max()) + wide
        key = (true_start.tobytes(), first, last, path.pitch_mm)
        if casts is None:
            casts = {}
        if key not in casts:
            casts.clear()
            to_sensor = np.linalg.inv(true_start)
            vertices = solid.vertices_mm @ to_sensor[:3, :3].T + to_sensor[:3, 3]
            tree = plant(vertices, solid.faces)
            cast = lay_out(
                tree, true_start, self.sheet, self.camera, surface,
                first_mm=first, last_mm=last, pitch_mm=path.pitch_mm,
            )  # fmt: skip
            casts[key] = tree, cast
        tree, cast = casts[key]
        stripes = cast.stripes.of(specimen, cast.part_mm)
        glow = None
        if surface.mirror > 0:
            glow = second_light(tree, self.camera, surface, where, rng)
        return expose(
            stripes,
            self.sheet,
            self.camera,
            self.finder,
            self.faults,
            where,
            begin + path.start_s,
            rng,
            translucence_mm=surface.depth_mm,
            glow=glow,
            keep=keep,
        )

    def _edge_depths(self) -> tuple[float, float]:
        middle, half = self.camera.working_distance_mm, self.z_range_mm / 2
        return middle - half, middle + half

    def calibrated(self, rng: np.random.Generator) -> "Instrument":
        """Calibrate with a scan of a plate at stated heights, on a stage that stands still."""
        plan = self.plan
        low, high = self._edge_depths()
        margin = 0.02 * (high - low)
        stated = np.linspace(low - margin, high + margin, plan.heights)
        half_x = 1.2 * high * np.tan(self.camera.fov_rad / 2)
        pitch = 4 * self.sheet.waist_mm
        surface = OpticalSurface()
        # calibrated standing still and before anything went wrong
        fresh = replace(self, faults=Faults(), sheet=replace(self.sheet, exposure_s=1e-5))
        rows, depths = [], []
        for k, height in enumerate(stated):
            x = np.linspace(-half_x, half_x, 41)
            sag = plan.plate_bow_mm * (1 - (x / (half_x / 1.2)) ** 2)
            truth = height * (1 + plan.gauge_stretch) - plan.gauge_stretch * low
            truth += rng.normal(0, plan.gauge_mm)
            plate = _sheet_of(x, truth - sag, 40.0)
            path = Path(
                start=np.eye(4), direction=1, profiles=plan.frames, pitch_mm=pitch,
                rate_hz=100.0, start_s=0.0,
            )  # fmt: skip
            row, _, _ = fresh.rows_of(
                plate, surface, path, rng, specimen=int(rng.integers(2**31)) + k, moving=False
            )
            rows.append(row)
            depths.append(np.full(plan.frames, height))
        fitted = fit(np.concatenate(rows), np.concatenate(depths), self.camera.rows, plan)
        return replace(self, calibration=fitted)

    def scan(
        self,
        solid: Solid,
        surface: OpticalSurface,
        path: Path,
        rng: np.random.Generator,
        *,
        specimen: int,
        misplaced: NDArray[np.float64] | None = None,
        casts: Casts | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Scan a part.

        Parameters
        ----------
        rng
            Electronic noise, faults and phases of the stage; speckle belongs to `specimen`.
        specimen
            Seed of the surface's scattering phases.
        misplaced : (4, 4), optional
            Small rigid error of where the part lies, part -> part.
        casts : dict, optional
            One for all scans of this solid and surface by this sheet and camera.

        Returns
        -------
        depth_mm, intensity : (profiles, columns) float32
        """
        assert self.calibration is not None, "calibrate the instrument first"
        row, peak, _ = self.rows_of(
            solid, surface, path, rng, specimen=specimen, misplaced=misplaced, casts=casts
        )
        depth = self.calibration.depth_mm(row)
        if self.faults.lost_share > 0:
            run = 4
            starts = rng.random(depth.shape) < self.faults.lost_share / run
            gone = starts.copy()
            for k in range(1, run):
                gone[:, k:] |= starts[:, :-k]
            depth = np.where(gone, np.nan, depth)
        if self.faults.stall_share > 0:
            for i in np.flatnonzero(rng.random(path.profiles) < self.faults.stall_share):
                if i > 0:
                    depth[i], peak[i] = depth[i - 1], peak[i - 1]
        low, high = self._edge_depths()
        depth = np.floor(depth / self.step_mm + 0.5) * self.step_mm
        depth = np.where((depth >= low) & (depth <= high), depth, np.nan)
        peak = np.where(np.isfinite(depth), peak, 0.0)
        return depth.astype(np.float32), peak.astype(np.float32)


def _sheet_of(x: NDArray[np.float64], z: NDArray[np.float64], half_y: float) -> Solid:
    """Open strip z(x), long in y, facing the sensor."""
    count = x.size
    near = np.stack([x, np.full(count, -half_y), z], 1)
    far = np.stack([x, np.full(count, half_y), z], 1)
    i = np.arange(count - 1)
    faces = np.concatenate(
        [
            np.stack([i, i + count, i + 1], 1),
            np.stack([i + 1, i + count, i + count + 1], 1),
        ]
    )
    return Solid(vertices_mm=np.concatenate([near, far]), faces=faces)
