"""A closed triangle mesh, and the first hits of rays on it."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sensors.casting.hits import Hits
from sensors.casting.laser import Laser
from sensors.casting.sweep import sweep, sweepable
from sensors.surface.albedo import Albedo

if TYPE_CHECKING:
    from sensors.casting.embree import Rays, Tree

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_SAME_ROTATION = 1e-13  # difference of matrix elements; 4e-11 mm at 400 mm
_CLEARANCE_MM = 1e-6  # hits closer than 1 nm to a sight line's ends don't block it


class Scene:
    """A closed triangle mesh, part frame, mm; never changed after it is built.

    The sensor is assumed to be outside the solid: a scan's rays meet only the outer side of
    triangles.

    Parameters
    ----------
    vertices_mm : (V, 3)
        Vertices, part frame, mm.
    faces : (F, 3)
        Vertex numbers of each triangle, counter-clockwise seen from outside.

    Raises
    ------
    ValueError
        Where the arrays have other shapes, a vertex isn't finite or a number is out of range.
    """

    def __init__(self, vertices_mm: NDArray[Any], faces: NDArray[Any]) -> None:
        vertices = np.array(vertices_mm, dtype=np.float64, order="C")
        triangles = np.array(faces, dtype=np.int32, order="C")
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
            raise ValueError(f"vertices_mm must be (V, 3), not {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
            raise ValueError(f"faces must be (F, 3), not {triangles.shape}")
        if not np.isfinite(vertices).all():
            raise ValueError("vertices_mm must be finite")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise ValueError("faces must number existing vertices")
        self.vertices_mm = vertices
        self.faces = triangles
        self.normals = _normals(vertices, triangles)
        for array in (self.vertices_mm, self.faces, self.normals):
            array.flags.writeable = False
        self.reflectance: Albedo | None = None
        """Brightness of the part over its own coordinates, where it is known."""
        self._tree: Tree | None = None

    def __getstate__(self) -> dict[str, Any]:
        kept = ("vertices_mm", "faces", "reflectance")
        return {name: getattr(self, name) for name in kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        Scene.__init__(self, state["vertices_mm"], state["faces"])
        self.reflectance = state["reflectance"]

    def finished(self, reflectance: Albedo | None) -> "Scene":
        """Return the same part with a brightness of its own."""
        other = object.__new__(Scene)  # not copied by its state: that would build it anew
        for name, value in vars(self).items():
            setattr(other, name, value)
        other.reflectance = reflectance
        return other

    @property
    def tree(self) -> "Tree":
        """Embree's tree, built on first access."""
        if self._tree is None:
            from sensors.casting.embree import Tree

            self._tree = Tree(self.vertices_mm, self.faces, self.normals)
        return self._tree

    def cast(self, laser: Laser, poses: Floats) -> Hits:
        """Cast every ray of `laser` at every pose.

        Parameters
        ----------
        laser
            Rays of one profile, sensor frame.
        poses : (n, 4, 4)
            Rigid, sensor -> part.
        """
        n, m = len(poses), len(laser.x_mm)
        frame, place = frames(poses)
        runs = legs(frame) if m > 0 else []
        swept = [False] * len(runs)
        if sweepable(laser.x_mm, laser.slope_x):
            swept = self._worth_sweeping([m * (leg.stop - leg.start) for leg in runs])
        if len(runs) == 1 and swept[0]:
            depth, triangle = self._sweep(laser, frame, place)
            return Hits(depth_mm=depth, triangle=triangle)
        depth = np.full((n, m), np.nan)
        triangle = np.full((n, m), -1, dtype=np.int32)
        searched = np.zeros(n, dtype=bool)
        for leg, sweeps in zip(runs, swept, strict=True):
            if sweeps:
                depth[leg], triangle[leg] = self._sweep(laser, frame[leg], place[leg])
            else:
                searched[leg] = True
        if searched.any():
            depth[searched], triangle[searched] = self._search(
                laser, frame[searched], place[searched]
            )
        return Hits(depth_mm=depth, triangle=triangle)

    def _worth_sweeping(self, rays: list[int]) -> list[bool]:
        """Which legs of so many rays to sweep: a choice of speed alone.

        A sweep looks once at every triangle, a search costs as much as that of ten; building the
        tree, where there is none yet, as much as a hundred sweeps.
        """
        triangles = len(self.faces)
        swept = [10 * count >= triangles for count in rays]
        left = [count for count, sweeps in zip(rays, swept, strict=True) if not sweeps]
        if self._tree is None and len(left) * triangles < 100 * triangles + 10 * sum(left):
            return [True] * len(rays)
        return swept

    def _sweep(self, laser: Laser, frame: Floats, place: Floats) -> tuple[Floats, Ints]:
        return sweep(
            self.vertices_mm, self.faces, frame[0], place, laser.x_mm, laser.slope_x
        )

    def cast_by_tree(self, laser: Laser, poses: Floats) -> Hits:
        """Cast with Embree, whatever the poses; same result as `cast`.

        But for surfaces of overlapping bodies within 1e-7 of the part's size of each other, which
        Embree can't tell apart: it may name the other one.
        """
        depth, triangle = self._search(laser, *frames(poses))
        return Hits(depth_mm=depth, triangle=triangle)

    def _search(self, laser: Laser, frame: Floats, place: Floats) -> tuple[Floats, Ints]:
        from sensors.casting.embree import Rays

        n, m = len(frame), len(laser.x_mm)
        rays = Rays(
            frame=frame,
            origin=np.zeros((n, 3)),
            place=place,
            frame_of=np.repeat(np.arange(n), m),
            x_mm=np.tile(laser.x_mm, n),
            slope_x=np.tile(laser.slope_x, n),
        )
        depth, triangle = self.tree.first(rays, outside=True)
        return depth.reshape(n, m), triangle.reshape(n, m)

    def first_hit(self, origins_mm: Floats, directions: Floats) -> tuple[Floats, Ints]:
        """First hits of single rays, part frame.

        Parameters
        ----------
        origins_mm : (k, 3)
            Where the rays start, mm.
        directions : (k, 3)
            Where they go; any length but 0.

        Returns
        -------
        distance_mm : (k,) float64
            Distance from the origin, mm; NaN where the ray meets nothing.
        triangle : (k,) int32
            Number of the triangle; -1 where the ray meets nothing.
        """
        return self.tree.first(_single(origins_mm, directions))

    def blocked(
        self, from_mm: Floats, towards_mm: Floats, triangle: Ints | None = None
    ) -> NDArray[np.bool_]:
        """Whether the part lies strictly between two points, part frame.

        Parameters
        ----------
        from_mm : (k, 3)
            Points on the surface (or free), mm.
        towards_mm : (k, 3)
            The other ends, mm.
        triangle : (k,)
            The triangle on which each `from_mm` lies, which never blocks its own sight line.

        Returns
        -------
        (k,) bool
            True where the surface is met more than 1 nm away from both ends.
        """
        from_mm = np.asarray(from_mm, dtype=np.float64)
        towards_mm = np.broadcast_to(np.asarray(towards_mm, dtype=np.float64), from_mm.shape)
        way = towards_mm - from_mm
        length = np.linalg.norm(way, axis=1)
        _, hit = self.tree.first(
            _single(from_mm, way),
            nearest=_CLEARANCE_MM,
            farthest=length - _CLEARANCE_MM,
            ignored=triangle,
        )
        return hit >= 0


def frames(poses: Floats) -> tuple[Floats, Floats]:
    """Rotations part -> sensor (n, 3, 3) of poses (n, 4, 4), and the sensor's place in them.

    A rotation within rounding of the one before it is taken to be the same.
    """
    poses = np.asarray(poses, dtype=np.float64)
    frame = np.ascontiguousarray(poses[:, :3, :3].transpose(0, 2, 1))
    for leg in legs(frame):
        frame[leg] = frame[leg.start]
    t = poses[:, :3, 3]
    # In the order of `section.turn`, so that both casters round alike.
    place = frame[:, :, 0] * t[:, :1] + frame[:, :, 1] * t[:, 1:2] + frame[:, :, 2] * t[:, 2:]
    return frame, np.ascontiguousarray(place)


def legs(frame: Floats) -> list[slice]:
    """Find the runs of profiles of constant orientation in rotations (n, 3, 3)."""
    n = len(frame)
    moved = np.abs(np.diff(frame, axis=0)).max(axis=(1, 2), initial=0.0) > _SAME_ROTATION
    ends = [*(np.flatnonzero(moved) + 1).tolist(), n]
    out = []
    start = 0
    for end in ends:
        while start < end:  # many small steps may add up
            same = np.abs(frame[start:end] - frame[start]).max(axis=(1, 2)) <= _SAME_ROTATION
            stop = end if same.all() else start + int(np.argmin(same))
            out.append(slice(start, stop))
            start = stop
    return out


def _normals(vertices_mm: Floats, faces: Ints) -> Floats:
    a, b, c = (vertices_mm[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit: Floats = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    return unit


def _single(origins_mm: Floats, directions: Floats) -> "Rays":
    """Rays each in a frame of its own, z along the ray."""
    from sensors.casting.embree import Rays

    origins = np.ascontiguousarray(origins_mm, dtype=np.float64)
    directions = np.broadcast_to(np.asarray(directions, dtype=np.float64), origins.shape)
    along = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    # The axis least along the ray gives the frame's x.
    helper = np.eye(3)[np.argmin(np.abs(along), axis=1)]
    across = np.cross(helper, along)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frame = np.stack([across, np.cross(along, across), along], axis=1)
    count = len(origins)
    return Rays(
        frame=frame,
        origin=origins,
        place=np.zeros((count, 3)),
        frame_of=np.arange(count),
        x_mm=np.zeros(count),
        slope_x=np.zeros(count),
    )
