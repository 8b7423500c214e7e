"""Rays along any path: Embree proposes triangles, double precision decides hits.

Embree works in single precision: about 0.1 µm at 400 mm, and a hit near an edge may fall on the
wrong side of it. So the mesh goes into its tree about its own centre and with every triangle grown
by a margin far above that error; rays start where they enter the part's box; and what Embree names
is only a candidate, decided by `sensors.casting.section`. A candidate that doesn't hold is
replaced by one
of the triangles around it that the ray passes closely, or the ray is sent on behind it.
"""

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numba import njit
from numpy.typing import NDArray

from sensors.casting.section import Floats, Ints, passes_near, ray_depth

_GROWTH = 3e-5  # margin around each triangle, as a share of the mesh's half diagonal
_FOLLOWED = 512  # triangles looked at around a candidate
_BATCH = 1 << 18  # rays at a time
_GROWN = 1 << 14  # triangles at a time
ROUNDS = 40
"""Candidates of each ray before all triangles are tried."""


class Rays(NamedTuple):
    """Rays given in frames of their own.

    Attributes
    ----------
    frame : (n, 3, 3)
        Rows are the frame's axes in the part frame.
    origin, place : (n, 3)
        A vertex v has the frame's coordinates frame @ (v - origin) - place, mm.
    frame_of : (k,) int64
        Frame of each ray.
    x_mm, slope_x : (k,)
        Ray (x_mm, 0, 0) + depth·(slope_x, 0, 1) in its frame.
    """

    frame: Floats
    origin: Floats
    place: Floats
    frame_of: NDArray[np.int64]
    x_mm: Floats
    slope_x: Floats


class Skin(NamedTuple):
    """A mesh, its triangles' normals, and the triangles around each vertex.

    Attributes
    ----------
    vertices, faces, normals
        (V, 3) mm, (F, 3), (F, 3), part frame.
    ring_start, ring
        `ring[ring_start[v]:ring_start[v + 1]]` are the triangles around vertex v.
    """

    vertices: Floats
    faces: Ints
    normals: Floats
    ring_start: NDArray[np.int64]
    ring: Ints


class Limits(NamedTuple):
    """Limits of valid hits of each ray; see `Tree.first`."""

    nearest: Floats
    farthest: Floats
    ignored: Ints
    outside: bool


class Search(NamedTuple):
    """State of a search: where each ray continues, and its nearest hit so far.

    Attributes
    ----------
    directions : (k, 3)
        Of the rays, part frame.
    start, best : (k,)
        Ray parameter from which the ray continues, and that of the nearest hit.
    triangle : (k,)
        Of the nearest hit, -1 without one.
    """

    directions: Floats
    start: Floats
    best: Floats
    triangle: Ints


class Tree:
    """Embree's tree over a triangle mesh; finds the first hit of rays in double precision."""

    def __init__(self, vertices_mm: Floats, faces: Ints, normals: Floats) -> None:
        low, high = vertices_mm.min(axis=0), vertices_mm.max(axis=0)
        self._centre = (low + high) / 2
        half_mm = float(np.linalg.norm(high - low)) / 2
        self._margin_mm = _GROWTH * half_mm
        self._low, self._high = low - 4 * self._margin_mm, high + 4 * self._margin_mm
        self._scene = EmbreeScene(robust=True)
        corners = _grown(vertices_mm, faces, self._centre, self._margin_mm)
        TriangleMesh(self._scene, corners)
        ray = np.zeros((1, 3), dtype=np.float32)
        self._scene.run(ray, ray + 1, output=1)  # Embree builds at the first ray: forks share it
        self.skin = Skin(
            vertices_mm, faces, normals, *_triangles_at_vertices(faces, len(vertices_mm))
        )

    def first(
        self,
        rays: Rays,
        nearest: Floats | float = 0.0,
        farthest: Floats | float = np.inf,
        ignored: Ints | None = None,
        outside: bool = False,
    ) -> tuple[Floats, Ints]:
        """Return depth (k,) and triangle (k,) of the first hits; NaN and -1 where there is none.

        Parameters
        ----------
        rays
            The rays.
        nearest, farthest
            Only hits with nearest < depth < farthest count; (k,) or one number.
        ignored : (k,)
            A triangle that each ray passes through.
        outside
            Rays pass through triangles that they would meet from inside.
        """
        count = len(rays.frame_of)
        depth = np.full(count, np.nan)
        triangle = np.full(count, -1, dtype=np.int32)
        # Arrays of one layout, so that the loops are compiled once.
        nearest = np.array(np.broadcast_to(nearest, count), dtype=np.float64, order="C")
        farthest = np.array(np.broadcast_to(farthest, count), dtype=np.float64, order="C")
        if ignored is None:
            ignored = np.full(count, -1, dtype=np.int32)
        for begin in range(0, count, _BATCH):
            part = slice(begin, begin + _BATCH)
            batch = Rays(
                frame=rays.frame, origin=rays.origin, place=rays.place,
                frame_of=rays.frame_of[part], x_mm=rays.x_mm[part], slope_x=rays.slope_x[part],
            )  # fmt: skip
            limits = Limits(nearest[part], farthest[part], ignored[part], outside)
            self._first(batch, limits, depth[part], triangle[part])
        return depth, triangle

    def _first(self, rays: Rays, limits: Limits, depth: Floats, triangle: Ints) -> None:
        """Fill `depth` and `triangle` for one batch of rays."""
        origins, directions, start, live = _enter(rays, limits, self._low, self._high)
        best = np.full(len(depth), np.inf)
        search = Search(directions, start, best, triangle)
        for turn in range(ROUNDS):
            if live.size == 0:
                break
            found = self._scene.run(
                *_single_precision(origins, directions, start, live, self._centre), output=1
            )
            live = _judge(
                self.skin, rays, limits, search,
                live, found["primID"], found["tfar"].astype(np.float64),
                self._margin_mm, self._margin_mm * 2.0 ** (turn - 3),
            )  # fmt: skip
        if live.size:
            _try_all(self.skin, rays, limits, search, live)
        hit = triangle >= 0
        depth[hit] = best[hit]


def _grown(
    vertices_mm: Floats, faces: Ints, centre: Floats, margin_mm: float
) -> NDArray[np.float32]:
    """Corners (F, 3, 3) of the triangles about `centre`, each grown in its plane by `margin_mm`."""
    out = np.empty((len(faces), 3, 3), np.float32)
    places = np.ascontiguousarray((vertices_mm - centre).T)
    for first in range(0, len(faces), _GROWN):
        corner = places[:, faces[first : first + _GROWN].T]  # axis, corner, face
        way = np.roll(corner, -1, axis=1) - corner  # to the next corner
        way /= np.maximum(np.sqrt(_squares(way)), 1e-300)
        inward = way - np.roll(way, 1, axis=1)
        size = np.sqrt(_squares(inward))
        # |inward| = 2 cos(half the angle); the mitre 1 / sin is cut off in sharp corners.
        sine = np.sqrt(np.clip(1 - (size / 2) ** 2, 0.0, 1.0))
        step = margin_mm / np.maximum(sine, 0.25)
        grown = corner - inward / np.maximum(size, 1e-300) * step
        out[first : first + _GROWN] = grown.transpose(2, 1, 0)
    return out


def _squares(vectors: Floats) -> Floats:
    """Squares of the lengths of vectors (3, ...)."""
    return np.asarray(vectors[0] ** 2 + vectors[1] ** 2 + vectors[2] ** 2)


def _triangles_at_vertices(faces: Ints, count: int) -> tuple[NDArray[np.int64], Ints]:
    """For each vertex the triangles around it, as one list with the starts of its runs."""
    flat = faces.ravel()
    order = np.argsort(flat, kind="stable")
    start = np.zeros(count + 1, dtype=np.int64)
    np.cumsum(np.bincount(flat, minlength=count), out=start[1:])
    return start, (order // 3).astype(np.int32)


@njit(cache=True, error_model="numpy")
def _enter(
    rays: Rays, limits: Limits, low: Floats, high: Floats
) -> tuple[Floats, Floats, Floats, NDArray[np.int64]]:
    """Rays in the part frame and where they enter a box.

    Origins (k, 3), directions (k, 3) of length 1 or more, the ray parameter (k,) from which a hit
    may come, and the numbers of the rays that meet the box within their limits.
    """
    frame, origin, place, frame_of, x_mm, slope_x = rays
    count = len(frame_of)
    origins, directions = np.empty((count, 3)), np.empty((count, 3))
    start = np.empty(count)
    live = np.empty(count, dtype=np.int64)
    size = 0
    for r in range(count):
        f = frame_of[r]
        first, last = limits.nearest[r], limits.farthest[r]
        for axis in range(3):
            across, along = frame[f, 0, axis], frame[f, 2, axis]
            o = origin[f, axis] + x_mm[r] * across
            for k in range(3):
                o += frame[f, k, axis] * place[f, k]
            d = slope_x[r] * across + along
            origins[r, axis], directions[r, axis] = o, d
            if d == 0.0:
                if o < low[axis] or o > high[axis]:
                    last = -np.inf
                continue
            near, far = (low[axis] - o) / d, (high[axis] - o) / d
            first, last = max(first, min(near, far)), min(last, max(near, far))
        start[r] = first
        live[size] = r
        size += int(first < last)
    return origins, directions, start, live[:size].copy()


def _single_precision(
    origins: Floats, directions: Floats, start: Floats, live: NDArray[np.int64], centre: Floats
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where the live rays go on, about the mesh's centre, and their directions (k, 3)."""
    way = directions[live]
    where = origins[live] + start[live, None] * way - centre
    return where.astype(np.float32), way.astype(np.float32)


@njit(cache=True)
def _holds(values: Ints, size: int, wanted: int) -> bool:
    """Whether `wanted` is among the first `size` values."""
    i = 0
    while i < size and values[i] != wanted:
        i += 1
    return i < size


@njit(cache=True)
def _judge(  # noqa: C901 - one compiled loop
    skin: Skin, rays: Rays, limits: Limits, search: Search,
    live: NDArray[np.int64], candidate: Ints, ahead: Floats, margin_mm: float, step_mm: float,
) -> NDArray[np.int64]:  # fmt: skip
    """Decide Embree's candidates in double precision; return the rays that must go on."""
    vertices, faces, normals, ring_start, ring = skin
    frame, origin, place, frame_of, x_mm, slope_x = rays
    nearest, farthest, ignored, outside = limits
    directions, start, best, triangle = search
    on = np.empty(len(live), dtype=np.int64)
    queue = np.empty(_FOLLOWED, dtype=np.int32)
    corners = np.empty(3 * _FOLLOWED, dtype=np.int32)
    count = 0
    for i in range(len(live)):
        r = live[i]
        t = candidate[i]
        if t < 0:
            continue
        f, x, s = frame_of[r], x_mm[r], slope_x[r]
        at = start[r] + ahead[i]
        if best[r] < at or at - margin_mm > farthest[r]:
            continue  # what was found before is nearer
        facing = (
            normals[t, 0] * directions[r, 0]
            + normals[t, 1] * directions[r, 1]
            + normals[t, 2] * directions[r, 2]
        ) < 0.0
        axes, zero, stands = frame[f], origin[f], place[f]
        d = np.inf
        if t != ignored[r]:
            d = ray_depth(vertices, faces, t, axes, zero, stands, x, s, outside)
        if nearest[r] < d < farthest[r]:
            if d < best[r] or (d == best[r] and t < triangle[r]):
                best[r], triangle[r] = d, t
            if facing:
                continue
        # Follow the ray over the triangles that hang together with the candidate and that it
        # passes closely: a few around an edge or a corner, more along a wall that it grazes.
        queue[0] = t
        one = int(np.int64(1))  # no literal: one type, compiled once
        size, head, turned = one, one - 1, one - 1
        while head < size:
            for corner in range(3):
                v = faces[queue[head], corner]
                if _holds(corners, turned, v):
                    continue
                corners[turned] = v
                turned += 1
                for k in range(ring_start[v], ring_start[v + 1]):
                    n = ring[k]
                    if (
                        size == _FOLLOWED
                        or not passes_near(
                            vertices, faces, n, axes, zero, stands, x, s, margin_mm
                        )
                        or _holds(queue, size, n)
                    ):
                        continue
                    queue[size] = n
                    size += 1
                    if n == ignored[r]:
                        continue
                    d = ray_depth(vertices, faces, n, axes, zero, stands, x, s, outside)
                    if nearest[r] < d < farthest[r] and (
                        d < best[r] or (d == best[r] and n < triangle[r])
                    ):
                        best[r], triangle[r] = d, n
            head += 1
        if best[r] <= at + 4 * margin_mm:
            continue
        start[r] = at + step_mm
        on[count] = r
        count += 1
    return on[:count].copy()


@njit(cache=True)
def _try_all(
    skin: Skin, rays: Rays, limits: Limits, search: Search, live: NDArray[np.int64]
) -> None:
    """Test rays without a decision against every triangle."""
    vertices, faces = skin.vertices, skin.faces
    frame, origin, place, frame_of, x_mm, slope_x = rays
    nearest, farthest, ignored, outside = limits
    best, triangle = search.best, search.triangle
    for r in live:
        f = frame_of[r]
        for t in range(len(faces)):
            if t == ignored[r]:
                continue
            d = ray_depth(
                vertices, faces, t, frame[f], origin[f], place[f], x_mm[r], slope_x[r], outside
            )
            if nearest[r] < d < farthest[r] and d < best[r]:
                best[r], triangle[r] = d, t
