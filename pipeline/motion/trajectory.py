"""The sensor's path: one pose per profile from waypoints and speeds.

A leg runs straight from one waypoint to the next at its own speed; positions are interpolated
linearly, orientations by slerp, at equal steps of `speed / rate` (Sensors 2023, 23, 7624,
section 2.1).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from files.errors import RecipeError
from pipeline.motion.limits import Motion, WaypointPath
from sensors.datasheet import Datasheet

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Trajectory:
    """Where the sensor was told to be.

    Attributes
    ----------
    poses : (n, 4, 4) float64
        Sensor frame -> part frame, mm.
    time_s : (n,) float64
        Seconds since the first profile.
    facts : dict
        What was drawn (length, speed, angles, direction ...), for the manifest.
    """

    poses: Array
    time_s: Array
    facts: dict[str, float]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Reach:
    """What a straight path sees around the point that its middle looks at.

    Attributes
    ----------
    line, along : (3,)
        Unit vectors of the laser line and of the travel across the nominal look, part frame.
    half_line_mm : float
        Half the length of the laser line at the distance of that point, mm.
    half_path_mm : float
        Half the way from the first profile to the last, mm.
    """

    line: Array
    along: Array
    half_line_mm: float
    half_path_mm: float


def frame(look: Sequence[float], travel: Sequence[float]) -> Array:
    """Return the (3, 3) rotation whose z is `look` and whose y is nearest to `travel`.

    Raises
    ------
    RecipeError
        Where the two are parallel or zero.
    """
    z = np.asarray(look, dtype=float)
    y = np.asarray(travel, dtype=float)
    if not np.linalg.norm(z) > 0:
        raise RecipeError("'motion.look' must not be zero", value=list(look))
    z = z / np.linalg.norm(z)
    y = y - (y @ z) * z
    if not np.linalg.norm(y) > 1e-9:
        raise RecipeError(
            "'motion.travel' must not be parallel to 'motion.look'", value=list(travel)
        )
    y = y / np.linalg.norm(y)
    return np.stack([np.cross(y, z), y, z], axis=1)


def tilted(base: Array, roll_deg: float, pitch_deg: float, yaw_deg: float) -> Array:
    """Turn the frame `base` about its own z (yaw), then new x (pitch), then new y (roll)."""
    turn = Rotation.from_euler("ZXY", [yaw_deg, pitch_deg, roll_deg], degrees=True)
    return np.asarray(base @ turn.as_matrix())


def poses_along(
    positions_mm: Array, rotations: Array, speeds_mm_s: Array, rate_hz: float, profiles: int
) -> tuple[Array, Array]:
    """Sample a polyline with one profile every 1/rate seconds, starting at the first waypoint.

    Parameters
    ----------
    positions_mm : (k, 3)
        Waypoints, sensor origins in the part frame.
    rotations : (k, 3, 3)
        Orientation at each waypoint.
    speeds_mm_s : (k-1,)
        Speed on each leg.
    rate_hz : float
        Profiles per second.
    profiles : int
        How many profiles; the last one must lie on the path.

    Returns
    -------
    poses : (profiles, 4, 4)
    time_s : (profiles,)

    Raises
    ------
    RecipeError
        Where the path ends before the last profile: nothing is padded.
    """
    lengths = np.linalg.norm(np.diff(positions_mm, axis=0), axis=1)
    if not (lengths > 0).all():
        raise RecipeError("two waypoints of the path coincide", allowed="legs longer than 0 mm")
    reached_s = np.concatenate([[0.0], np.cumsum(lengths / speeds_mm_s)])
    time_s = np.arange(profiles) / rate_hz
    if time_s[-1] > reached_s[-1] * (1 + 1e-9):
        fit = int(np.floor(reached_s[-1] * rate_hz * (1 + 1e-9))) + 1
        raise RecipeError(
            f"the path is too short: {fit} of {profiles} profiles fit on it at {rate_hz:g} Hz",
            allowed="fewer profiles, a longer path, a lower speed or a higher profile rate",
        )
    leg = np.clip(np.searchsorted(reached_s, time_s, side="right") - 1, 0, len(lengths) - 1)
    share = np.clip((time_s - reached_s[leg]) / np.diff(reached_s)[leg], 0.0, 1.0)
    poses = np.tile(np.eye(4), (profiles, 1, 1))
    steps = np.diff(positions_mm, axis=0)
    poses[:, :3, 3] = positions_mm[leg] + share[:, None] * steps[leg]
    # a leg without rotation keeps the very same matrix, so that casting can tell
    turning = ~(rotations[1:] == rotations[:-1]).all(axis=(1, 2))
    poses[:, :3, :3] = rotations[leg]
    for index in np.flatnonzero(turning):
        on = leg == index
        slerp = Slerp([0.0, 1.0], Rotation.from_matrix(rotations[index : index + 2]))
        poses[on, :3, :3] = slerp(share[on]).as_matrix()
    return poses, time_s


def follow(
    path: WaypointPath, motion: Motion, datasheet: Datasheet, profiles: int, part_centre_mm: Array
) -> Trajectory:
    """Follow a path whose waypoints the recipe states."""
    base = frame(motion.look, motion.travel)
    positions = np.array([point.at_mm for point in path.waypoints], dtype=float)
    if path.relative_to == "part_centre":
        positions = positions + part_centre_mm
    rotations = np.stack(
        [tilted(base, p.roll_deg, p.pitch_deg, p.yaw_deg) for p in path.waypoints]
    )
    default = datasheet.travel_speed_mm_s
    speeds = np.array(
        [p.speed_mm_s if p.speed_mm_s is not None else default for p in path.waypoints[:-1]]
    )
    rate_hz = rate_of(motion, datasheet)
    poses, time_s = poses_along(positions, rotations, speeds, rate_hz, profiles)
    length = float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
    facts = {"length_mm": length, "profile_rate_hz": rate_hz}
    return Trajectory(poses=poses, time_s=time_s, facts=facts)


def rate_of(motion: Motion, datasheet: Datasheet) -> float:
    """Profiles per second: the recipe's, else the sensor's.

    Raises
    ------
    RecipeError
        Where the recipe asks for more than the sensor can do.
    """
    if motion.profile_rate_hz is None:
        return datasheet.profile_rate_hz
    if motion.profile_rate_hz > datasheet.profile_rate_hz:
        raise RecipeError(
            "'motion.profile_rate_hz' is beyond the sensor",
            value=motion.profile_rate_hz,
            allowed=f"at most {datasheet.profile_rate_hz:g} ({datasheet.name})",
        )
    return motion.profile_rate_hz


def draw(
    motion: Motion,
    datasheet: Datasheet,
    profiles: int,
    *,
    aim_at: Callable[[np.random.Generator, Reach], tuple[Array, int]],
    rng: np.random.Generator,
) -> Trajectory:
    """Draw one straight path within the recipe's limits.

    Parameters
    ----------
    motion : Motion
        The limits.
    datasheet : Datasheet
        Rate and default speed; the working distance is kept from the aim, plus the stand-off.
    profiles : int
        Profiles in the scan.
    aim_at : callable
        Draws the point (part frame, mm) that the middle of the path looks at, within the reach of
        that path, and the instance of the flaw that was meant; 0: none.
    rng : Generator
        Source of all draws, in a fixed order.
    """
    base = frame(motion.look, motion.travel)
    roll, pitch, yaw = (
        float(size.draw(rng)) for size in (motion.roll_deg, motion.pitch_deg, motion.yaw_deg)
    )
    turned = tilted(base, roll, pitch, yaw)
    rate_hz = rate_of(motion, datasheet)
    speed = datasheet.travel_speed_mm_s
    if motion.speed_mm_s is not None:
        speed = float(motion.speed_mm_s.draw(rng))
    if motion.length_mm is not None:
        length = float(motion.length_mm.draw(rng))
        if motion.speed_mm_s is None:
            speed = length * rate_hz / profiles
        else:
            # an encoder triggers the profiles; the stage goes no faster than the sensor can
            speed = min(speed, length * rate_hz / profiles)
            rate_hz = profiles * speed / length
    length = profiles * speed / rate_hz
    direction = int(motion.direction.draw(rng))
    standoff = float(motion.standoff_mm.draw(rng))
    # the path runs where the yawed sensor travels, in the plane across the nominal look
    yawed = tilted(base, 0.0, 0.0, yaw)
    along = yawed[:, 1] * direction
    step = speed / rate_hz
    span = step * (profiles - 1)
    distance = datasheet.working_distance_mm + standoff
    reach = Reach(
        line=yawed[:, 0],
        along=along,
        half_line_mm=datasheet.half_line_mm(distance),
        half_path_mm=span / 2,
    )
    aim, instance = aim_at(rng, reach)
    middle = aim - turned[:, 2] * distance
    ends = np.stack([middle - along * span / 2, middle + along * span / 2])
    poses = np.tile(np.eye(4), (profiles, 1, 1))
    poses[:, :3, :3] = turned
    share = np.arange(profiles) / max(profiles - 1, 1)
    poses[:, :3, 3] = ends[0] + share[:, None] * (ends[1] - ends[0])
    facts = {
        "length_mm": length,
        "speed_mm_s": float(speed),
        "profile_rate_hz": rate_hz,
        "direction": float(direction),
        "standoff_mm": standoff,
        "roll_deg": roll,
        "pitch_deg": pitch,
        "yaw_deg": yaw,
        "aimed_at_flaw": float(instance > 0),
        "aimed_at_instance": instance,
    }
    return Trajectory(poses=poses, time_s=np.arange(profiles) / rate_hz, facts=facts)


def sweeps(
    poses: Array, points_mm: Array, datasheet: Datasheet, most_poses: int | None = None
) -> NDArray[np.bool_]:
    """Return which points (k, 3), part frame, the laser plane crosses within line and range.

    Between two profiles the plane is taken to move straight; `most_poses` of the path are looked
    at where it has more.
    """
    if most_poses is not None:
        poses = poses[np.unique(np.linspace(0, len(poses) - 1, most_poses).astype(int))]
    local = np.einsum("nkj,nji->nki", points_mm - poses[:, None, :3, 3], poses[:, :3, :3])
    x, y, z = np.moveaxis(local, -1, 0)
    within = np.abs(z - datasheet.working_distance_mm) <= datasheet.z_range_mm / 2
    within &= np.abs(x - datasheet.line_middle_mm) <= datasheet.half_line_mm(z)
    crossed = np.diff(np.signbit(y), axis=0) & within[1:] & within[:-1]
    return np.asarray(crossed.any(axis=0))
