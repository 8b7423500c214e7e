"""A patch of a solid's faces closed off around a box: inside the box it is the whole solid.

A face that stays away from an axis-parallel box lies beyond one of the box's six planes. So does
each edge of a patch's rim. Triangles that fill the rim beyond these planes never enter the box,
and what the closed patch and the solid differ by is a closed surface outside the box: their
winding numbers differ by one integer everywhere in the box. Copies of a sphere around the box
take it away. Where the fill crosses itself or the patch doesn't matter outside the box.
"""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Plane = int  # 0, 1, 2: above in x, y, z; 3, 4, 5: below

_CLEARANCE = 0.25  # of the box's size: how far the fill's own vertices stand off the box


class Unclosable(RuntimeError):
    """A patch can't be closed off; one line says why."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ClosedPatch:
    """A closed mesh whose first faces are a patch of a solid.

    Parameters
    ----------
    vertices_mm
        (V, 3) float64; the patch's vertices first, bit by bit.
    faces
        (F, 3) int64; the patch's faces first, then the fill.
    patch
        (n,) the solid's faces that make the patch.
    corners
        (v,) the solid's vertex that each of the patch's vertices is.
    """

    vertices_mm: Floats
    faces: Ints
    patch: Ints
    corners: Ints

    def change(
        self, vertices_mm: Floats, faces: NDArray[np.integer], source: NDArray[np.integer],
        about_mm: Floats,
    ) -> tuple[float, float]:  # fmt: skip
        """Return what carving did: the patch's area that went, and by how much the volume grew.

        Faces that stay cancel one by one, so neither is a difference of large sums.

        Parameters
        ----------
        vertices_mm, faces
            What this was carved into.
        source
            (n,) the face of this that each of `faces` is, or is a piece of; -1: none.
        about_mm
            (3,) a point of the skin at the flaw: faces near it count little for themselves.
        """
        old, old_mm3 = _measured(self.vertices_mm, self.faces, about_mm)
        new, new_mm3 = _measured(vertices_mm, faces, about_mm)
        skin, count = source >= 0, len(self.faces)
        gone = old - np.bincount(source[skin], new[skin], count)
        grown = np.bincount(source[skin], new_mm3[skin], count) - old_mm3
        return float(gone[: len(self.patch)].sum()), float(grown.sum() + new_mm3[~skin].sum())


def _measured(
    vertices_mm: Floats, faces: NDArray[np.integer], about_mm: Floats
) -> tuple[Floats, Floats]:
    """Return the areas of faces, and the volumes between them and a point."""
    about = vertices_mm - about_mm
    a, b, c = (about.take(faces[:, i], axis=0) for i in range(3))
    cross = np.cross(b - a, c - a)
    return np.linalg.norm(cross, axis=1) / 2, np.einsum("ij,ij->i", a, cross) / 6


class FaceBoxes:
    """The axis-parallel boxes of a solid's faces, to find those that meet a box."""

    def __init__(self, vertices_mm: Floats, faces: NDArray[np.integer]) -> None:
        turned = np.ascontiguousarray(faces.T)  # a row each: least and greatest of long rows
        corner = [np.ascontiguousarray(vertices_mm[:, axis])[turned] for axis in range(3)]
        self._low = [values.min(axis=0) for values in corner]
        self._high = [values.max(axis=0) for values in corner]
        self._longest = int(np.argmax(np.ptp(vertices_mm, axis=0)))
        # Along the longest axis faces are sorted: the search is in a slab of the solid.
        self._order = np.argsort(self._low[self._longest], kind="stable")
        self._first = self._low[self._longest][self._order]
        self._width = float((self._high[self._longest] - self._low[self._longest]).max())

    def meeting(self, box_mm: Floats) -> Ints:
        """Return the faces (n,), ascending, whose boxes meet the box (2, 3)."""
        axis = self._longest
        begin, end = np.searchsorted(
            self._first, (box_mm[0, axis] - self._width, np.nextafter(box_mm[1, axis], np.inf))
        )
        found = self._order[begin:end]
        for axis in range(3):
            low, high = self._low[axis][found], self._high[axis][found]
            found = found[(low <= box_mm[1, axis]) & (high >= box_mm[0, axis])]
        return np.sort(found).astype(np.int64)


def close_off(
    vertices_mm: Floats, faces: NDArray[np.integer], patch: Ints, box_mm: Floats
) -> ClosedPatch:
    """Close a patch off around a box.

    Parameters
    ----------
    vertices_mm, faces
        A closed solid, wound outwards.
    patch
        (n,) its faces whose boxes meet `box_mm`, all of them, see `FaceBoxes.meeting`.
    box_mm
        (2, 3) least and greatest corner.

    Raises
    ------
    Unclosable
        When no face runs through the box: then nothing says whether the box is full or empty.
    """
    corners, local = np.unique(faces[patch], return_inverse=True)
    local = local.reshape(-1, 3).astype(np.int64)
    points = vertices_mm[corners]
    spot = _point_in(points[local], box_mm)
    nodes = _Nodes(box_mm, len(points))
    fans, flow = _fans(local, _beyond(points, box_mm), nodes)
    around = _filling(flow)
    closed = np.concatenate([points, nodes.places_mm])
    rest = np.concatenate([np.delete(local, spot[0], axis=0), fans, nodes.octants(around)])
    # On a facet the winding number is the mean of both sides': 1/2 for a solid.
    excess = round(_winding(closed[rest], spot[1]) - 0.5)
    sphere = nodes.octants(around - excess)
    return ClosedPatch(
        vertices_mm=closed,
        faces=np.concatenate([local, fans, sphere]),
        patch=patch,
        corners=corners.astype(np.int64),
    )


def _beyond(points: Floats, box_mm: Floats) -> NDArray[np.bool_]:
    """Return beyond which of the six planes (n, 6) points lie."""
    return np.concatenate([points > box_mm[1], points < box_mm[0]], axis=1)


_EDGES = [(a, b) for a, b in combinations(range(6), 2) if b != a + 3]
_EDGE_OF = {pair: number for number, (a, b) in enumerate(_EDGES) for pair in ((a, b), (b, a))}


def _octant_planes() -> list[tuple[Plane, Plane, Plane]]:
    """Return the three planes of each octant, counterclockwise as seen from outside."""
    found = []
    for below in product((0, 1), repeat=3):
        x, y, z = (axis + 3 * sign for axis, sign in enumerate(below))
        found.append((x, z, y) if sum(below) % 2 else (x, y, z))
    return found


_OCTANTS = _octant_planes()


class _Nodes:
    """Vertices beyond the planes: one for each plane, pair of planes and octant."""

    def __init__(self, box_mm: Floats, first: int) -> None:
        centre = box_mm.mean(axis=0)
        reach = np.ptp(box_mm, axis=0) / 2 + _CLEARANCE * float(np.ptp(box_mm, axis=0).max())
        towards = np.concatenate([np.eye(3), -np.eye(3)])
        directions = [
            *towards,
            *(towards[a] + towards[b] for a, b in _EDGES),
            *(towards[list(planes)].sum(axis=0) for planes in _OCTANTS),
        ]
        self.places_mm = centre + reach * np.array(directions)
        self._first = first

    def plane(self, planes: Ints) -> Ints:
        return planes + self._first

    def edge(self, a: Ints, b: Ints) -> Ints:
        number = np.full((6, 6), -1, np.int64)
        for (one, other), edge in _EDGE_OF.items():
            number[one, other] = edge
        found: Ints = self._first + 6 + number[a, b]
        return found

    def octants(self, copies: Ints) -> Ints:
        """Return triangles (n, 3) of the octants of the sphere, each so many times."""
        found = []
        for octant, (planes, times) in enumerate(zip(_OCTANTS, copies, strict=True)):
            corner = self._first + 6 + len(_EDGES) + octant
            triangles = []
            for a, b in zip(planes, (*planes[1:], planes[0]), strict=True):
                edge = self._first + 6 + _EDGE_OF[a, b]
                triangles += [
                    [self._first + a, edge, corner],
                    [edge, self._first + b, corner],
                ]
            turned = np.array(triangles)[:, :: 1 if times > 0 else -1]
            found += [turned] * abs(int(times))
        return np.concatenate(found) if found else np.zeros((0, 3), np.int64)


def _rim(faces: Ints) -> tuple[Ints, Ints]:
    """Return starts and ends (n,) of the edges that are walked one way more often."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    size = int(faces.max()) + 1
    key = np.minimum(start, end) * size + np.maximum(start, end)
    keys, place = np.unique(key, return_inverse=True)
    net = np.bincount(place, np.where(start < end, 1, -1)).astype(np.int64)
    keys, net = np.repeat(keys, np.abs(net)), np.repeat(net, np.abs(net))
    low, high = keys // size, keys % size
    return np.where(net > 0, low, high), np.where(net > 0, high, low)


def _fans(faces: Ints, beyond: NDArray[np.bool_], nodes: _Nodes) -> tuple[Ints, Ints]:
    """Fill the rim up to the nodes.

    Returns
    -------
    triangles
        (n, 3).
    flow
        (6, 6) how often the triangles walk from one plane's node to another's, by their edge's.
    """
    start, end = _rim(faces)
    both = beyond[start] & beyond[end]
    if not both.any(axis=1).all():
        raise Unclosable("an edge of the patch's rim runs through the box")
    plane = both.argmax(axis=1).astype(np.int64)
    fans = [np.stack([end, start, nodes.plane(plane)], axis=1)]
    arriving, leaving = np.lexsort((plane, end)), np.lexsort((plane, start))
    here, before, after = end[arriving], plane[arriving], plane[leaving]
    turn = before != after
    here, before, after = here[turn], before[turn], after[turn]
    edge = nodes.edge(before, after)
    fans.append(np.stack([here, nodes.plane(before), edge], axis=1))
    fans.append(np.stack([here, edge, nodes.plane(after)], axis=1))
    flow = np.zeros((6, 6), np.int64)
    np.add.at(flow, (before, after), 1)
    return np.concatenate(fans), flow


def _filling(flow: Ints) -> Ints:
    """Return how many copies (8,) of each octant bound the flow between the planes' nodes."""
    boundary = np.zeros((len(_EDGES), len(_OCTANTS)))
    wanted = np.array([flow[b, a] - flow[a, b] for a, b in _EDGES])
    for octant, planes in enumerate(_OCTANTS):
        for a, b in zip(planes, (*planes[1:], planes[0]), strict=True):
            boundary[_EDGE_OF[a, b], octant] = 1 if a < b else -1
    copies = np.linalg.lstsq(boundary, wanted, rcond=None)[0]
    found: Ints = np.rint(copies - copies[0]).astype(np.int64)
    if (boundary @ found != wanted).any():
        raise Unclosable("the patch's rim doesn't close")
    return found


def _point_in(triangles: Floats, box_mm: Floats) -> tuple[int, Floats]:
    """Return a triangle that runs through the box, and a point of it in the box."""
    inside = ((triangles.mean(axis=1) > box_mm[0]) & (triangles.mean(axis=1) < box_mm[1])).all(
        axis=1
    )
    areas = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    # Large ones first: the winding number is sharpest far from their edges.
    for number in np.lexsort((-areas, ~inside)):
        polygon = _clipped(triangles[number], box_mm)
        if len(polygon) >= 3 and areas[number] > 0:
            return int(number), polygon.mean(axis=0)
    raise Unclosable("no face runs through the box")


def _clipped(polygon: Floats, box_mm: Floats) -> Floats:
    """Clip a convex polygon (n, 3) by a box; Sutherland and Hodgman, CACM 17, 32 (1974)."""
    for axis, sign, bound in [(a, s, box_mm[(s + 1) // 2, a]) for a in range(3) for s in (-1, 1)]:
        inner = sign * (bound - polygon[:, axis])
        kept = []
        for i in range(len(polygon)):
            j = (i + 1) % len(polygon)
            if inner[i] > 0:
                kept.append(polygon[i])
            if (inner[i] > 0) != (inner[j] > 0):
                share = inner[i] / (inner[i] - inner[j])
                kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
        polygon = np.array(kept).reshape(-1, 3)
        if len(polygon) < 3:
            break
    return polygon


def _winding(triangles: Floats, point: Floats) -> float:
    """Return the winding number at a point: the sum of solid angles over 4 pi.

    Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 125 (1983), eq. 8.
    """
    a, b, c = (triangles[:, i] - point for i in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    dot = np.einsum
    top = dot("ij,ij->i", a, np.cross(b, c))
    below = (
        la * lb * lc
        + dot("ij,ij->i", a, b) * lc
        + dot("ij,ij->i", b, c) * la
        + dot("ij,ij->i", c, a) * lb
    )
    return float(np.arctan2(top, below).sum() / (2 * np.pi))
