"""Feature edges of a part: chains of mesh edges at which two faces meet at a crease."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from defects.surface.geodesic import CREASE_RAD
from defects.surface.surface import Site, SiteError, Surface, tangent_axes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CORNER_RAD = np.deg2rad(50.0)
"""A chain that turns by more at a vertex has a corner there and ends: twice the crease of 32°
is no bend that a tessellated rim makes, and less than the corner of any drilled or milled edge."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Frames:
    """Frames along a chain at n positions; unit vectors (n, 3).

    Parameters
    ----------
    points_mm
        (n, 3) places on the edge.
    along
        The edge's direction.
    left, right
        From the edge into the face on its left and on its right, square to the edge.
    outward
        The bisector of the two faces' normals.
    """

    points_mm: Floats
    along: Floats
    left: Floats
    right: Floats
    outward: Floats


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Chain:
    """One feature edge: consecutive mesh edges of one sign, without corners.

    Parameters
    ----------
    points_mm
        (n, 3) vertices in order; a closed chain repeats the first at the end.
    left_normals, right_normals
        (n, 3) unit normals of the faces to the left and right, blended at the vertices.
    left_faces, right_faces
        (n - 1,) faces beside each piece.
    vertices
        (n,) numbers of the vertices in the mesh.
    convex
        Whether the material lies within the edge (an outer edge) or around it (an inner one).
    """

    points_mm: Floats
    left_normals: Floats
    right_normals: Floats
    left_faces: Ints
    right_faces: Ints
    vertices: Ints
    convex: bool

    @property
    def closed(self) -> bool:
        """Return whether the chain runs round."""
        return bool(self.vertices[0] == self.vertices[-1])

    @property
    def knots_mm(self) -> Floats:
        """Return the position (n,) of each vertex along the chain."""
        steps = np.linalg.norm(np.diff(self.points_mm, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def frames(self, along_mm: Floats) -> Frames:
        """Return the frames at positions (n,) along the chain.

        Raises
        ------
        SiteError
            When a position lies beyond the end of an open chain, or a closed one would be run
            through more than once.
        """
        knots = self.knots_mm
        at = np.asarray(along_mm, np.float64)
        if self.closed:
            if np.ptp(at) > 0.9 * knots[-1]:
                raise SiteError("the flaw is longer than the edge")
            at = np.mod(at, knots[-1])
        elif at.min() < 0.0 or at.max() > knots[-1]:
            raise SiteError("the flaw would pass the end of the edge")

        def between(values: Floats) -> Floats:
            return np.stack([np.interp(at, knots, values[:, i]) for i in range(3)], axis=1)

        piece = np.diff(self.points_mm, axis=0)
        piece /= np.linalg.norm(piece, axis=1, keepdims=True)
        along = _unit(between(_at_vertices(piece, self.closed)))
        first, second = between(self.left_normals), between(self.right_normals)
        outward = first + second
        outward = _unit(outward - np.sum(outward * along, axis=1, keepdims=True) * along)
        return Frames(
            points_mm=between(self.points_mm),
            along=along,
            left=_unit(np.cross(first, along)),
            right=_unit(np.cross(along, second)),
            outward=outward,
        )


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _at_vertices(pieces: Floats, closed: bool) -> Floats:
    """Return unit vectors (n, 3) at the vertices from those (n - 1, 3) of the pieces."""
    before = np.concatenate([pieces[-1:] if closed else pieces[:1], pieces])
    after = np.concatenate([pieces, pieces[:1] if closed else pieces[-1:]])
    return _unit(before + after)


@lru_cache(maxsize=4)
def feature_edges(surface: Surface) -> tuple[Chain, ...]:
    """Find the feature edges of a part, longest first; cached."""
    faces = surface.faces.astype(np.int64)
    tail = faces.ravel()
    head = np.roll(faces, -1, axis=1).ravel()
    face = np.repeat(np.arange(len(faces)), 3)
    count = len(surface.vertices_mm)
    key = tail * count + head
    order = np.argsort(key)
    twin = np.searchsorted(key[order], head * count + tail)
    twin = np.where(twin < len(key), twin, 0)
    partner = order[twin]
    paired = (key[partner] == head * count + tail) & (tail < head)
    here, there = face[paired], face[partner[paired]]
    cosine = np.sum(surface.normals[here] * surface.normals[there], axis=1)
    crease = cosine < np.cos(CREASE_RAD)
    ends = np.stack([tail[paired], head[paired]], axis=1)[crease]
    beside = np.stack([here, there], axis=1)[crease]
    centre = surface.vertices_mm[faces[beside[:, 1]]].mean(axis=1)
    lift = np.sum(
        (centre - surface.vertices_mm[ends[:, 0]]) * surface.normals[beside[:, 0]], axis=1
    )
    chains: list[Chain] = []
    for convex in (True, False):
        chosen = (lift < 0) == convex
        chains += _chains(surface, ends[chosen], beside[chosen], convex)
    return tuple(sorted(chains, key=lambda chain: -float(chain.knots_mm[-1])))


def _chains(surface: Surface, ends: Ints, beside: Ints, convex: bool) -> list[Chain]:
    """Join mesh edges (k, 2) with the faces to their left and right (k, 2) into chains."""
    at: dict[int, list[int]] = {}
    for edge, (a, b) in enumerate(ends.tolist()):
        at.setdefault(a, []).append(edge)
        at.setdefault(b, []).append(edge)
    vertices = surface.vertices_mm
    limit = np.cos(CORNER_RAD)

    def onward(edge: int, vertex: int) -> int | None:
        """Return the edge that goes on from `vertex`, or None at a corner or a junction."""
        meeting = at[vertex]
        if len(meeting) != 2:
            return None
        other = meeting[0] if meeting[1] == edge else meeting[1]
        come = vertices[vertex] - vertices[_other(ends[edge], vertex)]
        go = vertices[_other(ends[other], vertex)] - vertices[vertex]
        size = np.linalg.norm(come) * np.linalg.norm(go)
        return other if other != edge and float(come @ go) > limit * float(size) else None

    used = np.zeros(len(ends), np.bool_)
    found: list[Chain] = []
    for seed in range(len(ends)):
        if used[seed]:
            continue
        path = [int(ends[seed, 0]), int(ends[seed, 1])]
        line = [seed]
        used[seed] = True
        for back in (False, True):
            while path[0] != path[-1] or len(path) == 2:
                tip = path[0] if back else path[-1]
                following = onward(line[0] if back else line[-1], tip)
                if following is None or used[following]:
                    break
                used[following] = True
                line.insert(0 if back else len(line), following)
                path.insert(0 if back else len(path), _other(ends[following], tip))
        found.append(_chain(surface, path, ends[line], beside[line], convex))
    return found


def _other(ends: Ints, vertex: int) -> int:
    return int(ends[1] if ends[0] == vertex else ends[0])


def _chain(surface: Surface, path: list[int], ends: Ints, beside: Ints, convex: bool) -> Chain:
    numbers = np.array(path, np.int64)
    forward = (ends[:, 0] == numbers[:-1]) & (ends[:, 1] == numbers[1:])
    left = np.where(forward, beside[:, 0], beside[:, 1])
    right = np.where(forward, beside[:, 1], beside[:, 0])
    closed = path[0] == path[-1]
    return Chain(
        points_mm=surface.vertices_mm[numbers],
        left_normals=_at_vertices(surface.normals[left], closed),
        right_normals=_at_vertices(surface.normals[right], closed),
        left_faces=left,
        right_faces=right,
        vertices=numbers,
        convex=convex,
    )


def nearest_edge(surface: Surface, point_mm: Floats, convex: bool) -> tuple[Chain, float]:
    """Return the chain of a sign nearest to a point (3,), and the position along it.

    Raises
    ------
    SiteError
        When the part has no such edge.
    """
    best: tuple[float, Chain, float] | None = None
    for chain in feature_edges(surface):
        if chain.convex != convex:
            continue
        start, piece = chain.points_mm[:-1], np.diff(chain.points_mm, axis=0)
        share = np.sum((point_mm - start) * piece, axis=1) / np.sum(piece * piece, axis=1)
        share = np.clip(share, 0.0, 1.0)
        gap = np.linalg.norm(start + share[:, None] * piece - point_mm, axis=1)
        near = int(np.argmin(gap))
        if best is None or gap[near] < best[0]:
            step = float(np.linalg.norm(piece[near]))
            best = (float(gap[near]), chain, float(chain.knots_mm[near] + share[near] * step))
    if best is None:
        raise SiteError(f"the part has no {'convex' if convex else 'concave'} edge")
    return best[1], best[2]


def site_on_edge(chain: Chain, along_mm: float) -> Site:
    """Return the site at a position along a chain: normal outward, heading along the edge."""
    frames = chain.frames(np.array([along_mm]))
    normal = frames.outward[0]
    first, second = tangent_axes(normal)
    heading = float(np.arctan2(frames.along[0] @ second, frames.along[0] @ first))
    piece = int(np.searchsorted(chain.knots_mm, along_mm, side="right")) - 1
    face = int(chain.left_faces[min(max(piece, 0), len(chain.left_faces) - 1)])
    return Site(
        position_mm=frames.points_mm[0], normal=normal, heading_rad=heading, triangle=face
    )
