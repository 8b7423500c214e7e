"""Aim of a scan: surface points visible to the sensor, and the check of a path."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.injection.flawed_part import FlawedPart
from pipeline.motion.given_path import given_path
from pipeline.motion.limits import Motion
from pipeline.motion.trajectory import Reach, Trajectory, draw, frame, rate_of, sweeps
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from pipeline.passes.straight_passes import Pass
from pipeline.seeds import RngOf
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet

Floats = NDArray[np.float64]

STEEPEST_RAD = np.radians(80.0)  # faces steeper than this to the look give no useful return
PASSES = 200  # poses of a given path at which its sweep is looked at
OFF_MM = 1e-3  # a flaw's centre is looked at from outside its own face
AIMS = 16  # points of the surface among which one in the open is looked for
CHECK_PROFILES, CHECK_POINTS = 24, 96  # the coarse scan that judges a drawn path


class Outlook:
    """Surface points of a part that the scans of a recipe can see.

    From a path that the recipe gives: what lies in the fan and the working range somewhere along
    it. From drawn paths: whatever has a free way along the nominal look. From planned passes: what
    any of them sweeps with a free way along its look.

    Attributes
    ----------
    facing : (F,) bool
        Faces that are turned towards the sensor; parts of them may lie in the shade of others.
    """

    def __init__(
        self,
        part: Part,
        scene: Scene,
        motion: Motion,
        datasheet: Datasheet,
        profiles: int,
        passes: Sequence[Pass] = (),
    ) -> None:
        self._scene = scene
        self._datasheet = datasheet
        self.passes = tuple(passes)
        self._path: Trajectory | None = None
        if motion.path is not None:
            centre = part.bounds_mm.mean(axis=0)
            self._path = given_path(motion, datasheet, profiles, centre)
        self._look = frame(motion.look, motion.travel)[:, 2]
        self._far_mm = float(np.ptp(part.bounds_mm, axis=0).sum()) * 2
        looks = np.stack([one.look for one in passes] or [self._look])
        self.facing: NDArray[np.bool_] = (
            -(scene.normals @ looks.T) > np.cos(STEEPEST_RAD)
        ).any(axis=1)

    def free(self, points_mm: Floats) -> NDArray[np.bool_]:
        """Return which surface points (k, 3), part frame, the sensor can see."""
        if self.passes:
            seen = [
                sweeps(one.poses(PASSES), points_mm, self._datasheet)
                & ~self._scene.blocked(points_mm, points_mm - self._far_mm * one.look)
                for one in self.passes
            ]
            return np.asarray(np.any(seen, axis=0))
        free = ~self._scene.blocked(points_mm, points_mm - self._far_mm * self._look)
        if self._path is not None:
            free &= sweeps(self._path.poses, points_mm, self._datasheet, PASSES)
        return free


class Aimer:
    """Draws paths over one specimen until a path sees enough of it."""

    def __init__(
        self,
        *,
        flawed: FlawedPart,
        outlook: Outlook,
        scene: Scene,
        motion: Motion,
        datasheet: Datasheet,
        laser: Laser,
        profiles: int,
    ) -> None:
        self.flawed, self.scene, self.motion = flawed, scene, motion
        self._outlook = outlook
        self.datasheet, self.laser, self.profiles = datasheet, laser, profiles
        part = flawed.part
        corners = part.vertices_mm[part.faces[outlook.facing]]
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._corners = corners
        self._areas = np.cumsum(np.linalg.norm(crossed, axis=1))
        self._bounds_mm = part.bounds_mm
        self._enough: float | None = None
        if len(self._areas) == 0 or not self._areas[-1] > 0:
            raise PartError(part.name, "no face can be seen along motion.look", "another look")

    def path(self, rng_of: RngOf, number: int = 0) -> tuple[Trajectory, int]:
        """Draw paths until one sees enough; also return the number of paths drawn.

        Where passes are planned, scan `number` of the specimen takes the next of them.

        Raises
        ------
        PartError
            Where a given path sees nothing, or none of `motion.tries` paths saw enough.
        """
        if self._outlook.passes:
            return self._planned(number), 1
        if self.motion.path is not None:
            centre = self._bounds_mm.mean(axis=0)
            path = given_path(self.motion, self.datasheet, self.profiles, centre)
            if self._share_seen(path) == 0:
                raise PartError(
                    self.flawed.part.name,
                    "the path of the recipe sees nothing of the part",
                    "another motion.path, at the working distance from the part",
                )
            return path, 1
        if self._enough is None:  # the same for every scan of the specimen
            self._enough = self.motion.least_seen * self._share_seen(self._centred())
        missed: tuple[Trajectory, int] | None = None  # sees enough, yet not the flaw meant
        for attempt in range(self.motion.tries):
            path = draw(
                self.motion,
                self.datasheet,
                self.profiles,
                aim_at=self._aim,
                rng=rng_of("trajectory", attempt),
            )
            share = self._share_seen(path)
            if share > 0 and share >= self._enough:
                if self.holds(path, int(path.facts["aimed_at_instance"])):
                    return path, attempt + 1
                missed = missed or (path, attempt + 1)
        if missed is not None:
            return missed
        raise PartError(
            self.flawed.part.name,
            f"none of {self.motion.tries} paths saw {self.motion.least_seen:.0%} of what a path"
            " over its middle sees",
            "a stand-off within the sensor's range, smaller tilts, a lower motion.least_seen",
        )

    def _planned(self, number: int) -> Trajectory:
        """Return the pass that is this scan's turn, evenly triggered along its length."""
        count = len(self._outlook.passes)
        taken = self._outlook.passes[number % count]
        rate_hz = rate_of(self.motion, self.datasheet)
        facts = {
            "length_mm": taken.length_mm,
            "speed_mm_s": taken.length_mm * rate_hz / self.profiles,
            "profile_rate_hz": rate_hz,
            "planned_pass": number % count,
            "planned_passes": count,
        }
        return Trajectory(
            poses=taken.poses(self.profiles),
            time_s=np.arange(self.profiles) / rate_hz,
            facts=facts,
        )

    def holds(self, path: Trajectory, instance: int) -> bool:
        """Whether the centre of a flaw lies in a path's scan, unobstructed from the laser.

        Every path holds instance 0, no flaw.
        """
        if instance == 0:
            return True
        flaw = next(flaw for flaw in self.flawed.flaws if flaw.instance == instance)
        centre = (flaw.position_mm + OFF_MM * flaw.normal)[None]
        if not sweeps(path.poses, centre, self.datasheet).any():
            return False
        along = path.poses[:, :3, 1]
        offset = np.einsum("ij,ij->i", centre - path.poses[:, :3, 3], along)
        emitter = path.poses[np.argmin(np.abs(offset)), None, :3, 3]
        return not bool(self.scene.blocked(centre, emitter)[0])

    def _share_seen(self, path: Trajectory) -> float:
        rows = np.unique(np.linspace(0, self.profiles - 1, CHECK_PROFILES).astype(int))
        count = self.laser.x_mm.size
        columns = np.unique(np.linspace(0, count - 1, CHECK_POINTS).astype(int))
        coarse = Laser(x_mm=self.laser.x_mm[columns], slope_x=self.laser.slope_x[columns])
        depth = self.scene.cast(coarse, path.poses[rows]).depth_mm
        with np.errstate(invalid="ignore"):
            off = np.abs(depth - self.datasheet.working_distance_mm)
            return float((off <= self.datasheet.z_range_mm / 2).mean())

    def _centred(self) -> Trajectory:
        """Return the nominal path over the middle of the visible surface."""
        middles = self._corners.mean(axis=1)
        weights = np.diff(self._areas, prepend=0.0)
        middle = np.average(middles, axis=0, weights=weights)
        # the surface point nearest to the middle, so that a ring is not aimed at its hole's depth
        aim = middles[np.argmin(np.linalg.norm(middles - middle, axis=1))]

        def at_middle(_rng: np.random.Generator, _reach: Reach) -> tuple[Floats, int]:
            return aim, 0

        return draw(
            self.motion,
            self.datasheet,
            self.profiles,
            aim_at=at_middle,
            rng=np.random.default_rng(0),
        )

    def _aim(self, rng: np.random.Generator, reach: Reach) -> tuple[Floats, int]:
        """Draw where the path's middle looks, and the flaw meant.

        A flaw lies off the middle by no more than `aim_jitter` of what line and path reach.
        """
        at_flaw = bool(rng.uniform() < self.motion.aim_at_flaws) and bool(self.flawed.flaws)
        if at_flaw:
            flaw = self.flawed.flaws[int(rng.integers(len(self.flawed.flaws)))]
            part_span = np.ptp(self._bounds_mm, axis=0).max() / 2
            across, along = rng.uniform(-1, 1, size=2) * np.minimum(
                self.motion.aim_jitter * np.array([reach.half_line_mm, reach.half_path_mm]),
                part_span,
            )
            return flaw.position_mm + reach.line * across + reach.along * along, flaw.instance
        # the first of some points of facing faces that no other face shades
        picks = np.searchsorted(self._areas, rng.uniform(0, self._areas[-1], AIMS), side="right")
        corners = self._corners[np.minimum(picks, len(self._corners) - 1)]
        u, v = np.sort(rng.uniform(size=(2, AIMS)), axis=0)[..., None]
        points = u * corners[:, 0] + (v - u) * corners[:, 1] + (1 - v) * corners[:, 2]
        return np.asarray(points[np.argmax(self._outlook.free(points))]), 0
