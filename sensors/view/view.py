"""Geometry at each point of one scan: depth, slopes, angles, lines of sight.

A view is lazy: each property is computed on first access, kept, and never changed. A view belongs
to one set of poses; effects that act below the profile pitch or on the pose use another view, from
`shifted` and `posed`.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sensors.casting.hits import Hits
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.surface.albedo import Albedo
from sensors.view.mirror import Mirror, mirror, thickness_mm
from sensors.view.poses import displaced, to_part, travel_steps_mm, travelled_mm, turn_to_part
from sensors.view.view_cache import ViewCache
from sensors.view.visibility import camera_visible, facing_camera
from sensors.view.working_range import reasons

if TYPE_CHECKING:
    from sensors.model import SensorModel

Floats = NDArray[np.float64]

# Shifted views of scans up to this many points are kept for the next effect that asks.
KEPT_POINTS = 200_000
KEPT_IN_ALL = 2_000_000
"""Points of all shifted views that are kept: 100 MB, at fifty bytes or so each."""
TOGETHER = 400_000
"""Points of several views that are cast together: for more, a call costs next to nothing."""
KEPT_WIDTHS = 24
"""Widths of the line, and exposures, whose readings of a view are kept for the next who asks."""


class Reason(IntEnum):
    """Reason of a missing reading; stored as `invalid_reason`."""

    VALID = 0
    NO_HIT = 1
    OUT_OF_RANGE = 2
    HIDDEN_FROM_CAMERA = 3
    DROPOUT = 4


class View:
    """Geometry of one scan, n profiles of m points.

    Parameters
    ----------
    scene : Scene
        The closed part, part frame, mm.
    sensor : SensorModel
        The instrument: its datasheet and the effects that its file lists.
    poses : (n, 4, 4) array
        Sensor to part, rigid, one for each profile.
    time_s : (n,) array
        Seconds since the first profile.
    laser : Laser, optional
        Rays of a profile; the datasheet's where left out.
    hits : Hits, optional
        First hits where they are already known; cast when needed otherwise.
    reflectance : Albedo, optional
        Brightness of the part over its own coordinates; the scene's where left out.
    intensity : (n, m) array, optional
        Brightness that a recording gives, 0 to 1; comes before `reflectance`.
    start_time_s : float, optional
        When the first profile was taken, on a clock common to all recordings.
    travel_start_mm : float
        Path length at the first profile, where the view is a part of a longer scan.
    """

    def __init__(
        self,
        scene: Scene,
        sensor: "SensorModel",
        poses: ArrayLike,
        time_s: ArrayLike,
        *,
        laser: Laser | None = None,
        hits: Hits | None = None,
        reflectance: Albedo | None = None,
        intensity: Floats | None = None,
        start_time_s: float | None = None,
        travel_start_mm: float = 0.0,
    ) -> None:
        self.scene = scene
        self.sensor = sensor
        self.poses = np.asarray(poses, dtype=np.float64)
        self.time_s = np.asarray(time_s, dtype=np.float64)
        self.laser = Laser.from_datasheet(sensor.datasheet) if laser is None else laser
        self.reflectance = scene.reflectance if reflectance is None else reflectance
        self.intensity = intensity
        self.start_time_s = start_time_s
        self.travel_start_mm = travel_start_mm
        if self.poses.ndim != 3 or self.poses.shape[1:] != (4, 4):
            raise ValueError(f"poses must be (n, 4, 4), got {self.poses.shape}")
        if self.time_s.shape != self.poses.shape[:1]:
            raise ValueError(f"time_s must be ({len(self.poses)},), got {self.time_s.shape}")
        self._given_hits = hits
        self._seen: dict[float, NDArray[np.bool_]] = {}

    def __getstate__(self) -> dict[str, Any]:
        kept = (
            "scene", "sensor", "poses", "time_s", "laser", "reflectance", "intensity",
            "start_time_s", "travel_start_mm", "_given_hits",
        )  # fmt: skip
        return {key: self.__dict__[key] for key in kept} | {"_seen": {}}

    # ---- the scan itself

    @property
    def datasheet(self) -> Datasheet:
        """Datasheet of the sensor."""
        return self.sensor.datasheet

    @property
    def shape(self) -> tuple[int, int]:
        """Profiles and points of a profile, (n, m)."""
        return len(self.poses), self.laser.slope_x.size

    @cached_property
    def hits(self) -> Hits:
        """First hits, whatever their depth."""
        if self._given_hits is not None:
            return self._given_hits
        return self.scene.cast(self.laser, self.poses)

    @cached_property
    def reason(self) -> NDArray[np.uint8]:
        """Reason of a missing reading by geometry alone, (n, m), see `Reason`."""
        sheet = self.datasheet
        found: NDArray[np.uint8] = reasons(
            self.hits.depth_mm, sheet.depth_min_mm, sheet.depth_max_mm
        )
        return found

    @cached_property
    def in_range(self) -> NDArray[np.bool_]:
        """Where geometry gives a reading: a hit within the working range, (n, m)."""
        return np.asarray(self.reason == Reason.VALID)

    @cached_property
    def depth_mm(self) -> Floats:
        """Sensor z of the hit, (n, m) mm; NaN without a hit or outside the working range."""
        depth_mm = self.hits.depth_mm
        beyond = self.reason == Reason.OUT_OF_RANGE
        # without a hit beyond the range not copied, for the memory's sake
        return np.where(beyond, np.nan, depth_mm) if beyond.any() else np.asarray(depth_mm)

    @property
    def triangle(self) -> NDArray[np.int32]:
        """Triangle of the first hit, (n, m), -1 without one."""
        return self.hits.triangle

    # ---- places

    @cached_property
    def x_mm(self) -> Floats:
        """Sensor x of the hit, (n, m) mm, NaN at missing readings."""
        return self.laser.x_mm + self.depth_mm * self.laser.slope_x

    @property
    def off_axis_mm(self) -> Floats:
        """Position along the line: sensor x of the hit from the optical axis, (n, m) mm."""
        return self.x_mm - self.datasheet.optical_axis_x_mm

    @property
    def column_off_axis_mm(self) -> Floats:
        """Where each ray passes at the working distance, from the optical axis, (m,) mm."""
        return self.column_x_mm - self.datasheet.optical_axis_x_mm

    @cached_property
    def column_x_mm(self) -> Floats:
        """Where each ray passes at the working distance, (m,) mm."""
        return self.laser.x_mm + self.datasheet.working_distance_mm * self.laser.slope_x

    @cached_property
    def sensor_mm(self) -> Floats:
        """Points of the scan in the sensor frame, (n, m, 3) mm."""
        return self.laser.points_mm(self.depth_mm)

    @cached_property
    def part_mm(self) -> Floats:
        """Points of the scan in the part frame, (n, m, 3) mm."""
        return self.to_part(self.sensor_mm)

    def to_part(self, points_mm: Floats) -> Floats:
        """Move points (n, ..., 3) of the sensor frames into the part frame, mm."""
        return to_part(self.poses, points_mm)

    def turn_to_part(self, vectors: Floats) -> Floats:
        """Turn vectors (n, ..., 3) of the sensor frames into the part frame."""
        return turn_to_part(self.poses, vectors)

    @cached_property
    def travel_mm(self) -> Floats:
        """Path length at each profile, (n,) mm, counted positive where the sensor moves to +y."""
        return self.travel_start_mm + travelled_mm(self.poses)

    @cached_property
    def travel_step_mm(self) -> Floats:
        """Signed travel from each profile to the next, (n,) mm; the last repeats the one before."""
        return travel_steps_mm(self.poses)

    # ---- directions and angles

    @cached_property
    def normal(self) -> Floats:
        """Outward unit normal of the facet hit, (n, m, 3), sensor frame; NaN without a reading."""
        part = self.scene.normals[self.triangle]
        part[~self.in_range] = np.nan
        flat = part.reshape(len(part), -1, 3)
        return np.asarray(flat @ self.poses[:, :3, :3]).reshape(part.shape)

    @cached_property
    def slope_x(self) -> Floats:
        """Depth slope dz/dx of the surface, (n, m), sensor frame, signed; NaN without a reading."""
        return self._slope(0)

    @cached_property
    def slope_y(self) -> Floats:
        """Depth slope dz/dy of the surface, (n, m), sensor frame, signed; NaN without a reading."""
        return self._slope(1)

    def _slope(self, axis: int) -> Floats:
        across, along = self.normal[..., axis], self.normal[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(across == 0.0, 0.0, -across / along)

    @cached_property
    def ray(self) -> Floats:
        """Unit direction of the rays, (m, 3), sensor frame."""
        return self.laser.directions

    @cached_property
    def cos_incidence(self) -> Floats:
        """Cosine of the angle between laser ray and normal, (n, m), 0 to 1."""
        return np.asarray(np.clip(-np.einsum("nmk,mk->nm", self.normal, self.ray), 0.0, 1.0))

    @cached_property
    def incidence_rad(self) -> Floats:
        """Angle between laser ray and normal, (n, m) rad."""
        return np.asarray(np.arccos(self.cos_incidence))

    # ---- the camera

    @cached_property
    def camera_mm(self) -> Floats:
        """Camera's pupil in the sensor frame, (3,) mm.

        Raises
        ------
        RecipeError
            Where the datasheet doesn't state the triangulation angle.
        """
        return np.array([0.0, self.datasheet.camera_offset_mm, 0.0])

    @cached_property
    def cos_camera(self) -> Floats:
        """Cosine of the angle between normal and direction to the camera, (n, m), -1 to 1."""
        return facing_camera(
            self.scene.normals, self.triangle, self.poses, self.laser.x_mm, self.laser.slope_x,
            self.depth_mm, self.datasheet.camera_offset_mm,
        )  # fmt: skip

    @cached_property
    def cos_half_vector(self) -> Floats:
        """Cosine of the angle between the normal and the half vector of laser and camera, (n, m).

        That is the sum of the unit vectors to both, (2 + 2 cos γ)^½ long, γ between them.
        """
        away_mm = np.sqrt(self.x_mm**2 + self.datasheet.camera_offset_mm**2 + self.depth_mm**2)
        along = self.ray[:, 0] * self.x_mm + self.ray[:, 2] * self.depth_mm
        length = np.sqrt(2.0 + 2.0 * along / away_mm)
        return np.asarray(np.clip((self.cos_incidence + self.cos_camera) / length, -1, 1))

    @property
    def half_vector_rad(self) -> Floats:
        """Angle between the normal and the half vector of laser and camera, (n, m) rad."""
        return np.asarray(np.arccos(self.cos_half_vector))

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Where the line of sight to the datasheet's camera is free, (n, m); else False.

        Raises
        ------
        RecipeError
            Where the datasheet doesn't state the triangulation angle.
        """
        return self.visible_from(self.datasheet.camera_offset_mm)

    def visible_from(self, camera_y_mm: float) -> NDArray[np.bool_]:
        """Where a camera at (0, camera_y_mm, 0) of the sensor frame sees the laser's hit.

        A point is seen where its facet faces the camera and the part blocks no line of sight.

        Parameters
        ----------
        camera_y_mm : float
            The camera's place along y, signed, mm.

        Returns
        -------
        (n, m) bool
        """
        if camera_y_mm not in self._seen:
            seen = camera_visible(self.scene, self.laser, self.poses, self.hits, camera_y_mm)
            seen &= self.in_range
            self._seen[camera_y_mm] = seen
        return self._seen[camera_y_mm]

    # ---- second bounces and thickness, by single rays

    @cached_property
    def mirror(self) -> Mirror:
        """Second hits of the laser's specular reflection on the part."""
        return mirror(self)

    @cached_property
    def thickness_mm(self) -> Floats:
        """Path length of the laser's ray through the part behind each point, (n, m) mm."""
        return thickness_mm(self)

    # ---- brightness

    @cached_property
    def brightness(self) -> Floats | None:
        """Brightness of the line, (n, m), 0 to 1: the recording's, else the part's; else None."""
        if self.intensity is not None:
            return np.asarray(self.intensity, dtype=np.float64)
        if self.reflectance is not None:
            return self.reflectance.at(self.part_mm)
        return None

    # ---- other views of the same part

    def posed(self, poses: ArrayLike) -> "View":
        """Return the view from other poses (n, 4, 4), all else equal."""
        return self._like(poses=poses)

    def along(self, laser: Laser) -> "View":
        """Return the view along other rays, as many, all else equal."""
        return self._like(laser=laser)

    def with_sensor(self, sensor: "SensorModel") -> "View":
        """Return the view by a sensor with another datasheet or other effects, along these rays."""
        return self._like(sensor=sensor, hits=self.hits)

    def rows(self, part: slice) -> "View":
        """Return the view of some of the profiles, at their place in time and travel."""
        cast: Hits | None = self.__dict__.get("hits", self._given_hits)
        return self._like(
            poses=self.poses[part],
            time_s=self.time_s[part],
            hits=None if cast is None else cast.rows(part),
            intensity=None if self.intensity is None else self.intensity[part],
            travel_start_mm=float(self.travel_mm[part][0]),
        )

    def _like(self, **other: Any) -> "View":
        """Return the view with some of its arguments replaced; its hits only where given."""
        kept = (
            "sensor", "poses", "time_s", "laser", "reflectance", "intensity", "start_time_s",
            "travel_start_mm",
        )  # fmt: skip
        return View(self.scene, **{**{name: getattr(self, name) for name in kept}, **other})

    def shifted(
        self, dx_mm: ArrayLike = 0.0, dy_mm: ArrayLike = 0.0, dz_mm: ArrayLike = 0.0
    ) -> "View":
        """Return the view with each sensor displaced in its own frame.

        Parameters
        ----------
        dx_mm, dy_mm, dz_mm : float or (n,) array
            Displacement along the sensor's axes, one for all profiles or one for each.
        """
        parts = [np.asarray(d, dtype=np.float64) for d in (dx_mm, dy_mm, dz_mm)]
        if not any(d.any() for d in parts):
            return self
        key = tuple(d.tobytes() for d in parts)
        points = math.prod(self.shape)
        return _SHIFTED.get(
            self, key, lambda: self._displaced(parts), keep=points <= KEPT_POINTS, size=points
        )

    def shifted_each(
        self, moves_mm: Sequence[ArrayLike], *, axis: str, camera_y_mm: float | None = None
    ) -> Iterator["View"]:
        """Yield the view displaced by each of several moves.

        Those of a strip are cast together, which is faster; those of many points one by one, so
        that memory holds one of them.

        Parameters
        ----------
        moves_mm : float or (n,) array each
            Displacements along `axis`, "x" or "y", see `shifted`.
        camera_y_mm : float, optional
            Of a camera that is going to be asked what it sees.
        """
        views = (self.shifted(**{f"d{axis}_mm": move}) for move in moves_mm)
        if len(moves_mm) * math.prod(self.shape) > TOGETHER:
            yield from views
            return
        few = list(views)
        _cast_together([v for v in few if not v.is_cast])
        if camera_y_mm is not None:
            _seen_together([v for v in few if camera_y_mm not in v._seen], camera_y_mm)
        yield from few

    @property
    def is_cast(self) -> bool:
        """Whether first hits are known."""
        return self._given_hits is not None or "hits" in self.__dict__

    def _displaced(self, parts: list[Floats]) -> "View":
        shift_mm = np.stack(np.broadcast_arrays(*parts), axis=-1) + np.zeros((len(self.poses), 1))
        return self.posed(displaced(self.poses, shift_mm))


def _cast_together(views: list[View]) -> None:
    """Cast views of one laser and part whose hits aren't known."""
    if len(views) < 2:
        return
    first = views[0]
    hits = first.scene.cast(first.laser, np.concatenate([v.poses for v in views]))
    for view, rows in _rows_of_each(views):
        view._given_hits = hits.rows(rows)


def _seen_together(views: list[View], camera_y_mm: float) -> None:
    """Find what a camera sees in views of one laser and part."""
    if len(views) < 2:
        return
    first = views[0]
    seen = camera_visible(
        first.scene, first.laser, np.concatenate([v.poses for v in views]),
        Hits.joined([v.hits for v in views]), camera_y_mm,
    )  # fmt: skip
    for view, rows in _rows_of_each(views):
        view._seen[camera_y_mm] = seen[rows] & view.in_range


def _rows_of_each(views: list[View]) -> Iterator[tuple[View, slice]]:
    start = 0
    for view in views:
        yield view, slice(start, start + len(view.poses))
        start += len(view.poses)


_SHIFTED: ViewCache[View] = ViewCache(64, room=KEPT_IN_ALL)
# A quantity at each point of a view, broadcastable to (n, m).
ViewFunction = Callable[[View], Floats]
