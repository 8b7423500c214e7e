"""Straight passes of a sensor over a part, and what of the surface each of them sees."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.motion.trajectory import frame, sweeps
from pipeline.parts.part import Part
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LOOKS: Final = tuple(
    (x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)
)
"""Directions tried: along the faces, edges and corners of a cube, 26 in all."""

STEEPEST_DEG: Final = 75.0
"""Incidence beyond which a point isn't counted as seen."""

SWEPT_POSES: Final = 200  # of a pass, at which its sweep is looked at
OFF_MM: Final = 1e-3  # sight lines start outside the point's own face


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Samples:
    """Points spread evenly over a part's surface.

    Attributes
    ----------
    points_mm, normals : (k, 3)
    """

    points_mm: Floats
    normals: Floats

    @classmethod
    def of(cls, part: Part, scene: Scene, count: int, rng: np.random.Generator) -> "Samples":
        """Draw `count` points, uniform in area."""
        corners = part.vertices_mm[part.faces]
        areas = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        total = np.cumsum(areas)
        # one point in each of `count` equal shares of the area
        at = (np.arange(count) + rng.uniform(size=count)) / count * total[-1]
        face = np.minimum(np.searchsorted(total, at, side="right"), len(total) - 1)
        u, v = np.sort(rng.uniform(size=(2, count)), axis=0)[..., None]
        c = corners[face]
        points = u * c[:, 0] + (v - u) * c[:, 1] + (1 - v) * c[:, 2]
        return cls(points_mm=points, normals=scene.normals[face])


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pass:
    """One straight pass.

    Attributes
    ----------
    look, travel : (3,)
        Part frame.
    start_mm, end_mm : (3,)
        Sensor's origin at the first and the last profile.
    seen : (k,) bool
        Samples that laser and camera see, within line, range and `STEEPEST_DEG`.
    cosine : (k,)
        Cosine of the incidence; 0 where not seen.
    """

    look: Floats
    travel: Floats
    start_mm: Floats
    end_mm: Floats
    seen: Bools
    cosine: Floats

    @property
    def length_mm(self) -> float:
        """Length of the pass."""
        return float(np.linalg.norm(self.end_mm - self.start_mm))

    def poses(self, count: int) -> Floats:
        """Return poses (count, 4, 4), evenly spaced."""
        return _poses(self.look, self.travel, self.start_mm, self.end_mm, count)


def candidates(
    samples: Samples, scene: Scene, datasheet: Datasheet, *, overlap: float = 0.1
) -> Iterator[Pass]:
    """Lay parallel passes over the part from every look, both ways across, and look at each.

    A pass keeps the working distance from the middle of the depths that face it in its strip.

    Parameters
    ----------
    samples
        The surface.
    scene
        The part.
    datasheet
        Line, range and, where stated, the camera's place.
    overlap
        Share of the line by which neighbouring strips overlap.
    """
    for look in LOOKS:
        helper = (0.0, 1.0, 0.0) if abs(look[1]) < max(abs(look[0]), abs(look[2])) else (1.0, 0, 0)
        base = frame(look, helper)
        for axes in (base, np.stack([base[:, 1], -base[:, 0], base[:, 2]], axis=1)):
            yield from _strips(samples, scene, datasheet, axes, overlap)


def _strips(
    samples: Samples, scene: Scene, datasheet: Datasheet, axes: Floats, overlap: float
) -> Iterator[Pass]:
    local = samples.points_mm @ axes
    facing = -(samples.normals @ axes[:, 2]) > np.cos(np.radians(STEEPEST_DEG))
    if not facing.any():
        return
    x = local[facing, 0]
    low, high = x.min(), x.max()
    width = datasheet.x_fov_mm * (1 - overlap)
    count = max(int(np.ceil((high - low) / width)), 1)
    for k in range(count):
        middle = low + (high - low) * (k + 0.5) / count
        strip = facing & (np.abs(local[:, 0] - middle) <= datasheet.x_fov_mm / 2)
        if not strip.any():
            continue
        depth = local[strip, 2]
        z = (depth.min() + depth.max()) / 2 - datasheet.working_distance_mm
        y = local[strip, 1]
        margin = 0.02 * max(np.ptp(y), 1.0)
        ends = np.array([[middle, y.min() - margin, z], [middle, y.max() + margin, z]]) @ axes.T
        yield _look_at(samples, scene, datasheet, axes, ends)


def _look_at(
    samples: Samples, scene: Scene, datasheet: Datasheet, axes: Floats, ends: Floats
) -> Pass:
    look, travel = axes[:, 2], axes[:, 1]
    poses = _poses(look, travel, ends[0], ends[1], SWEPT_POSES)
    cosine = -(samples.normals @ look)
    seen = cosine > np.cos(np.radians(STEEPEST_DEG))
    seen &= sweeps(poses, samples.points_mm, datasheet)
    asked = np.flatnonzero(seen)
    points = samples.points_mm[asked] + OFF_MM * samples.normals[asked]
    along = (points - ends[0]) @ travel
    emitter = ends[0] + along[:, None] * travel
    if datasheet.columns == "even_x":  # parallel rays
        emitter = emitter + ((points - ends[0]) @ axes[:, 0])[:, None] * axes[:, 0]
    free = ~scene.blocked(points, emitter)
    if datasheet.triangulation_angle_deg is not None:
        centre = ends[0] + along[:, None] * travel
        free &= ~scene.blocked(points, centre + datasheet.camera_offset_mm * travel)
    seen[asked] = free
    return Pass(
        look=look, travel=travel, start_mm=ends[0], end_mm=ends[1], seen=seen,
        cosine=np.where(seen, cosine, 0.0),
    )  # fmt: skip


def _poses(look: Floats, travel: Floats, start: Floats, end: Floats, count: int) -> Floats:
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = np.stack([np.cross(travel, look), travel, look], axis=1)
    poses[:, :3, 3] = start + np.linspace(0, 1, count)[:, None] * (end - start)
    return poses
