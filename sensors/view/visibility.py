"""Lines of sight of a whole scan: laser points visible to the camera.

A point is seen if its triangle faces the camera and nothing stands on the straight line from it to
the camera of its own profile, at (0, ±b, 0) in the sensor frame. A sight line that leaves a solid
can only enter it again through a triangle that faces away from the camera. Those few triangles are
drawn as a coarse map of their least depth (`sensors.view.obstacles`); a line, or a whole tile of
lines,
that stays nearer than the map all its way is free, and only the rest is left to Embree. Lines run
through triangles that they would leave by, as the laser's rays do.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.casting.embree import Rays
from sensors.casting.hits import Hits
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene, frames, legs
from sensors.casting.section import Floats, Ints, turn
from sensors.view.obstacles import Obstacles, is_free, obstacles

_CLEARANCE_MM = 1e-6  # what is closer than 1 nm to a sight line's ends doesn't block it
_TILE_PROFILES, _TILE_POINTS = 8, 16
_PART_PROFILES, _PART_POINTS = 2, 4
_NEAR_CELLS = 6.0  # of the map
_HIDDEN, _SEEN, _OPEN = 0, 1, 2


class Lines(NamedTuple):
    """Lines of sight of a leg: sensor positions, rays, their depths, the camera's y."""

    place: Floats
    x_mm: Floats
    slope_x: Floats
    depth: Floats
    b: float


def camera_visible(
    scene: Scene,
    laser: Laser,
    poses: Floats,
    hits: Hits,
    camera_offset_mm: float,
    *,
    exhaustive: bool = False,
) -> NDArray[np.bool_]:
    """Return which hits of a scan the camera sees.

    Parameters
    ----------
    scene, laser, poses
        What was scanned; poses (n, 4, 4), sensor -> part.
    hits
        The scan's first hits, of `scene.cast`.
    camera_offset_mm
        y of the camera in the sensor frame, signed, mm.
    exhaustive
        Leave every line to Embree; slower, with the same result.

    Returns
    -------
    (n, m) bool
        True where there is a hit and the camera sees it.
    """
    poses = np.ascontiguousarray(poses, dtype=np.float64)
    frame, place = frames(poses)
    x_mm, slope_x = laser.x_mm, laser.slope_x
    depth, triangle = hits.depth_mm, hits.triangle
    b = float(camera_offset_mm)
    state, box = _facing(scene.normals, frame, x_mm, slope_x, depth, triangle, b)
    for leg in legs(frame):
        count = depth[leg].size
        if exhaustive or 6 * count < len(scene.faces) or not np.isfinite(box[leg]).any():
            continue
        low, high = box[leg, :3].min(axis=0), box[leg, 3:].max(axis=0)
        screen = obstacles(
            scene.vertices_mm, scene.faces, frame[leg.start], place[leg], low, high, b, count
        )
        if screen is not None:
            _screen(state[leg], Lines(place[leg], x_mm, slope_x, depth[leg], b), screen)
    profile, point = np.divmod(np.flatnonzero(state == _OPEN), state.shape[1])
    if profile.size:
        rays, length = _lines(poses, x_mm, slope_x, depth, profile, point, b)
        _, met = scene.tree.first(
            rays,
            nearest=_CLEARANCE_MM,
            farthest=length - _CLEARANCE_MM,
            ignored=triangle[profile, point],
            outside=True,
        )
        state[profile, point] = np.where(met >= 0, _HIDDEN, _SEEN)
    seen: NDArray[np.bool_] = state == _SEEN
    return seen


@njit(cache=True)
def _facing(
    normals: Floats, frame: Floats, x_mm: Floats, slope_x: Floats,
    depth: Floats, triangle: Ints, b: float,
) -> tuple[NDArray[np.uint8], Floats]:  # fmt: skip
    """Hits whose triangle faces the camera are open, all others hidden.

    Also, for each profile, the least and the largest x, x/depth, depth of the open ones (n, 6).
    """
    n, m = depth.shape
    state = np.zeros((n, m), dtype=np.uint8)
    box = np.empty((n, 6))
    for i in range(n):
        x0, s0, z0 = np.inf, np.inf, np.inf
        x1, s1, z1 = -np.inf, -np.inf, -np.inf
        turned = frame[i]
        for j in range(m):
            t = triangle[i, j]
            if t < 0:
                continue
            z = depth[i, j]
            x = x_mm[j] + slope_x[j] * z
            nx, ny, nz = turn(turned, normals[t, 0], normals[t, 1], normals[t, 2])
            if ny * b - nx * x - nz * z > 0.0:
                state[i, j] = _OPEN
                s = x / z
                x0, x1 = min(x0, x), max(x1, x)
                s0, s1 = min(s0, s), max(s1, s)
                z0, z1 = min(z0, z), max(z1, z)
        box[i, 0], box[i, 1], box[i, 2] = x0, s0, z0
        box[i, 3], box[i, 4], box[i, 5] = x1, s1, z1
    return state, box


@njit(cache=True)
def facing_camera(
    normals: Floats, triangle: Ints, poses: Floats, x_mm: Floats, slope_x: Floats,
    depth: Floats, b: float,
) -> Floats:  # fmt: skip
    """Cosine of the angle between a hit's normal and the way to the camera, (n, m), -1 to 1.

    Parameters
    ----------
    normals, triangle : outward normals (f, 3), part frame; the triangle (n, m) that is hit
    depth : (n, m) mm, NaN without a reading: the cosine is NaN then
    b : y of the camera, signed, mm
    """
    n, m = depth.shape
    out = np.empty((n, m))
    for i in range(n):
        r = poses[i]
        for j in range(m):
            z = depth[i, j]
            if np.isnan(z):
                out[i, j] = np.nan
                continue
            p = normals[triangle[i, j]]
            x = x_mm[j] + slope_x[j] * z
            nx = p[0] * r[0, 0] + p[1] * r[1, 0] + p[2] * r[2, 0]
            ny = p[0] * r[0, 1] + p[1] * r[1, 1] + p[2] * r[2, 1]
            nz = p[0] * r[0, 2] + p[1] * r[1, 2] + p[2] * r[2, 2]
            out[i, j] = (ny * b - nx * x - nz * z) / np.sqrt(x * x + b * b + z * z)
    return out


@njit(cache=True)
def _screen(
    state: NDArray[np.uint8], lines: Lines, screen: Obstacles
) -> None:
    """Mark as seen the open points whose sight line stays nearer than every obstacle.

    Lines are looked at in tiles, then in parts of those tiles, then one by one; and apart near the
    surface, where a tile may be too coarse, and far from it, where it rarely is.
    """
    n, m = lines.depth.shape
    reach = abs(lines.b)
    near = min(1.0, _NEAR_CELLS * screen.cell / reach)
    box = np.empty((4, 3))
    for first in range(0, n, _TILE_PROFILES):
        last = min(n, first + _TILE_PROFILES)
        for begin in range(0, m, _TILE_POINTS):
            end = min(m, begin + _TILE_POINTS)
            if not _bound(box, state, lines, first, last, begin, end):
                continue
            far_free = is_free(box, near, 1.0, reach, 0.25, screen)
            near_free = is_free(box, 0.0, near, reach, 0.25, screen)
            if far_free and near_free:
                _see(state, first, last, begin, end)
                continue
            for row in range(first, last, _PART_PROFILES):
                for column in range(begin, end, _PART_POINTS):
                    part = (
                        row, min(last, row + _PART_PROFILES),
                        column, min(end, column + _PART_POINTS),
                    )  # fmt: skip
                    _screen_part(box, state, lines, part, near, near_free, far_free, screen)


@njit(cache=True, inline="always")
def _screen_part(
    box: Floats, state: NDArray[np.uint8], lines: Lines, part: tuple[int, int, int, int],
    near: float, near_free: bool, far_free: bool, screen: Obstacles,
) -> None:  # fmt: skip
    """Look at a part of a tile, then at its lines one by one."""
    first, last, begin, end = part
    if not _bound(box, state, lines, first, last, begin, end):
        return
    reach = abs(lines.b)
    far_free = far_free or is_free(box, near, 1.0, reach, 0.25, screen)
    near_free = near_free or is_free(box, 0.0, near, reach, 0.25, screen)
    if far_free and near_free:
        _see(state, first, last, begin, end)
        return
    for i in range(first, last):
        for j in range(begin, end):
            if not _bound(box, state, lines, i, i + 1, j, j + 1):
                continue
            if (near_free or is_free(box, 0.0, near, reach, 0.125, screen)) and (
                far_free or is_free(box, near, 1.0, reach, 0.125, screen)
            ):
                state[i, j] = _SEEN


@njit(cache=True, inline="always")
def _see(state: NDArray[np.uint8], first: int, last: int, begin: int, end: int) -> None:
    """Mark the open points of a tile as seen."""
    for i in range(first, last):
        for j in range(begin, end):
            if state[i, j] == _OPEN:
                state[i, j] = _SEEN


@njit(cache=True)
def _bound(
    box: Floats, state: NDArray[np.uint8], lines: Lines,
    first: int, last: int, begin: int, end: int,
) -> bool:  # fmt: skip
    """Bound a tile's open points (box rows 0, 1) and their cameras (2, 3); False without any."""
    place, x_mm, slope_x, depth, b = lines
    x0, y0, z0 = np.inf, np.inf, np.inf
    x1, y1, z1 = -np.inf, -np.inf, -np.inf
    for axis in range(3):
        box[2, axis], box[3, axis] = np.inf, -np.inf
    for i in range(first, last):
        px, pz = place[i, 0], place[i, 2]
        there = False
        for j in range(begin, end):
            if state[i, j] == _OPEN:
                x, z = px + x_mm[j] + slope_x[j] * depth[i, j], pz + depth[i, j]
                x0, x1 = min(x0, x), max(x1, x)
                z0, z1 = min(z0, z), max(z1, z)
                there = True
        if there:
            y0, y1 = min(y0, place[i, 1]), max(y1, place[i, 1])
            box[2, 0], box[3, 0] = min(box[2, 0], px), max(box[3, 0], px)
            box[2, 2], box[3, 2] = min(box[2, 2], pz), max(box[3, 2], pz)
    box[0, 0], box[0, 1], box[0, 2] = x0, y0, z0
    box[1, 0], box[1, 1], box[1, 2] = x1, y1, z1
    box[2, 1], box[3, 1] = y0 + b, y1 + b
    return x0 <= x1


def _lines(
    poses: Floats, x_mm: Floats, slope_x: Floats, depth: Floats,
    profile: NDArray[np.int64], point: NDArray[np.int64], b: float,
) -> tuple[Rays, Floats]:  # fmt: skip
    """Sight lines of chosen points as rays in frames of their own, and their lengths in mm."""
    frame, origin, length = _line_frames(poses, x_mm, slope_x, depth, profile, point, b)
    count = len(profile)
    rays = Rays(
        frame=frame,
        origin=origin,
        place=np.zeros((count, 3)),
        frame_of=np.arange(count),
        x_mm=np.zeros(count),
        slope_x=np.zeros(count),
    )
    return rays, length


def _line_frames(
    poses: Floats, x_mm: Floats, slope_x: Floats, depth: Floats,
    profile: NDArray[np.int64], point: NDArray[np.int64], b: float,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Frames (k, 3, 3) with z along the sight line, its start (k, 3), its length (k,)."""
    z = depth[profile, point]
    x = x_mm[point] + slope_x[point] * z
    size = np.sqrt(x * x + b * b + z * z)
    flat = np.sqrt(x * x + z * z)
    # Sensor frame: along (-x, b, -z), across (z, 0, -x); the third makes it right-handed.
    ax, ay, az = -x / size, b / size, -z / size
    cx, cz = z / flat, -x / flat
    ux, uy, uz = ay * cz, az * cx - ax * cz, -ay * cx
    frame, origin = np.empty((len(z), 3, 3)), np.empty((len(z), 3))
    for k in range(3):
        p = poses[profile, k].T
        origin[:, k] = p[0] * x + p[2] * z + p[3]
        frame[:, 0, k] = p[0] * cx + p[2] * cz
        frame[:, 1, k] = p[0] * ux + p[1] * uy + p[2] * uz
        frame[:, 2, k] = p[0] * ax + p[1] * ay + p[2] * az
    return frame, origin, size
