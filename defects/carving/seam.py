"""Seams: a boolean meets a flaw's surface only where it crosses the part's skin.

Most facets of a flaw lie wholly in the material or wholly in the air. A boolean that had them all
would spend its time on them, and give them back as they came. So a few facets stand in for them,
on the same side of the skin and with the same rim; after the boolean the flaw's own are set in.
That is the same solid as long as no skin passes between the two, which is checked.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from defects.carving.bounding_box import bounding_box, row_boxes
from defects.carving.point_in_mesh import Inside, face_bins
from defects.carving.solid import BooleanError, Solid
from defects.carving.stitch import Carved, is_closed, same_corners

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FACES_PER_CELL = 2.0  # of the grid in which facets look for those near them
FLAT = 1e-12  # mm: a gap between two triangles that is no more than rounding


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StandIn:
    """A closed solid some of whose faces stand in for finer ones.

    Parameters
    ----------
    solid
        The solid.
    seen
        (F,) which of its faces the result of a boolean may show.
    standing, whole
        (F,) which of them stand in; which come out of the boolean whole, these among them.
    faces, further_mm
        (k, 3) and (v, 3): the finer faces, with the rim of those that stand in; numbers from
        the solid's last vertex on count in `further_mm`.
    """

    solid: Solid
    seen: Bools
    standing: Bools
    whole: Bools
    faces: Ints
    further_mm: Floats

    @property
    def vertices_mm(self) -> Floats:
        """Return the solid's vertices and the further ones."""
        return np.concatenate([self.solid.vertices_mm, self.further_mm])

    @property
    def between(self) -> Solid:
        """Return the closed surface between the finer faces and those that stand in."""
        back = self.solid.faces[self.standing][:, ::-1]
        return Solid(vertices_mm=self.vertices_mm, faces=np.concatenate([self.faces, back]))

    @property
    def fits(self) -> bool:
        """Return whether the finer faces have the rim of those that stand in."""
        return not self.standing.any() or self.between.closed

    def check(self, source: Ints) -> Bools:
        """Check which faces a boolean's result shows.

        Parameters
        ----------
        source
            (n,) the numbers of the solid's faces that the result's are, or are pieces of.

        Returns
        -------
        standing
            (n,) which of them stand in.

        Raises
        ------
        BooleanError
            When it shows others than it may, or one isn't whole that should be.
        """
        whole = np.sort(source[self.whole[source]])
        if not self.seen[source].all():
            raise BooleanError("seam: a face is seen that should be hidden")
        if not np.array_equal(whole, np.flatnonzero(self.whole)):
            raise BooleanError("seam: the skin crosses a face that should stay whole")
        standing: Bools = self.standing[source]
        return standing

    def set_in(self, carved: Carved, rows: Ints, source: Ints) -> tuple[Carved, Bools]:
        """Replace the faces that stand in.

        Parameters
        ----------
        carved
            Result of a boolean.
        rows, source
            (n,) its faces that are of this solid, and which each is or is a piece of.

        Returns
        -------
        Carved, kept
            The faces that are kept, those among (F,) before, come first.

        Raises
        ------
        BooleanError
            When the result isn't the same solid as with the finer faces, or isn't closed.
        """
        standing = self.check(source)
        rows, before = rows[standing], self.solid.faces[source[standing]]
        now = carved.faces[rows]
        same = same_corners(carved.vertices_mm[now], self.solid.vertices_mm[before])
        number = np.full(len(self.solid.vertices_mm) + len(self.further_mm), -1, np.int64)
        face, corner, old = np.nonzero(same)
        number[before[face, old]] = now[face, corner]
        first = len(self.solid.vertices_mm)
        number[first:] = len(carved.vertices_mm) + np.arange(len(self.further_mm))
        put = number[self.faces].astype(np.int32)
        kept = np.ones(len(carved.faces), np.bool_)
        kept[rows] = False
        faces = np.concatenate([carved.faces[kept], put])
        if (put < 0).any() or not is_closed(faces):
            raise BooleanError("seam: the faces set in have another rim")
        skin = carved.vertices_mm[carved.faces[kept & (carved.source_face >= 0)]]
        if self._meets(skin):
            raise BooleanError("seam: the skin passes between the faces set in and their stand-in")
        flaw = carved.instance[rows[0]]
        made = replace(
            carved,
            vertices_mm=np.concatenate([carved.vertices_mm, self.further_mm]),
            faces=faces,
            instance=np.append(carved.instance[kept], np.full(len(put), flaw)),
            source_face=np.append(carved.source_face[kept], np.full(len(put), -1, np.int32)),
        )
        return made, kept

    def _meets(self, skin_mm: Floats) -> bool:
        """Return whether triangles (n, 3, 3) meet the finer faces or lie behind them."""
        between = self.between
        a, b, c = (between.vertices_mm.take(self.faces[:, k], axis=0) for k in range(3))
        axes = _frame(np.cross(b - a, c - a))
        turned = between.vertices_mm @ axes.T
        used = np.zeros(len(turned), np.bool_)
        used[between.faces] = True  # the finer faces are among these
        low, high = bounding_box(turned[used])
        skin = (skin_mm.reshape(-1, 3) @ axes.T).reshape(-1, 3, 3)
        least, most = row_boxes(skin)
        near = np.logical_and.reduce(((most >= low) & (least <= high)).T)
        if not near.any():
            return False
        cell = max(float(np.sqrt(FACES_PER_CELL * np.prod((high - low)[:2]) / len(a))), 1e-9)
        nx, ny = (int(n) for n in np.floor((high - low)[:2] / cell) + 1)
        faces = self.faces.astype(np.int32)
        start, members = face_bins(turned, faces, low, cell, nx, ny)
        if _any_meet(skin[near], turned, faces, low, cell, nx, ny, start, members):
            return True
        return bool(Inside.of(between.vertices_mm, between.faces).contains(skin_mm[near, 0]).any())


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Seam:
    """A flaw that digs and piles up, as two solids that meet the skin only at their seams.

    Parameters
    ----------
    raised
        A button over the whole flaw, united with the part; its flat tops stand in for the flaw's.
    taken
        What lies above the flaw's surface under the skin: what goes.
    """

    raised: StandIn
    taken: StandIn


def _frame(cross: Floats) -> Floats:
    """Return axes (3, 3), the last along the mean normal of faces with area vectors (n, 3)."""
    up = cross.sum(axis=0)
    up /= max(float(np.linalg.norm(up)), 1e-300)
    side = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(up, side), up])


@njit(cache=True)
def _between(one: Floats, other: Floats, x: float, y: float, z: float) -> bool:
    """Return whether two triangles lie apart along a direction."""
    size = np.sqrt(x * x + y * y + z * z)
    low, high, least, most = np.inf, -np.inf, np.inf, -np.inf
    for k in range(3):
        a = x * one[k, 0] + y * one[k, 1] + z * one[k, 2]
        b = x * other[k, 0] + y * other[k, 1] + z * other[k, 2]
        low, high = min(low, a), max(high, a)
        least, most = min(least, b), max(most, b)
    return bool(max(low - most, least - high) > FLAT * size)


@njit(cache=True)
def _across(
    one: Floats, a: int, b: int, other: Floats, c: int, d: int
) -> tuple[float, float, float]:
    """Return the direction across two edges, a to b of one triangle and c to d of another."""
    x, y, z = one[b, 0] - one[a, 0], one[b, 1] - one[a, 1], one[b, 2] - one[a, 2]
    u, v, w = other[d, 0] - other[c, 0], other[d, 1] - other[c, 1], other[d, 2] - other[c, 2]
    return y * w - z * v, z * u - x * w, x * v - y * u


@njit(cache=True)
def _apart(one: Floats, other: Floats) -> bool:
    """Return whether a plane parallel to a face, or to an edge of each, parts two triangles."""
    i, j, k = int(np.int64(0)), int(np.int64(1)), int(np.int64(2))  # no literals: compiled once
    x, y, z = _across(other, i, j, other, i, k)
    if _between(one, other, x, y, z):
        return True
    x, y, z = _across(one, i, j, one, i, k)
    if _between(one, other, x, y, z):
        return True
    for i in range(3):
        for j in range(3):
            x, y, z = _across(one, i, (i + 1) % 3, other, j, (j + 1) % 3)
            if _between(one, other, x, y, z):
                return True
    return False


@njit(cache=True)
def _any_meet(
    others: Floats,
    places: Floats,
    faces: NDArray[np.int32],
    low: Floats,
    cell: float,
    nx: int,
    ny: int,
    start: NDArray[np.int32],
    members: NDArray[np.int32],
) -> bool:
    """Return whether one of the triangles (n, 3, 3) may meet one of the faces in the grid."""
    box = np.empty((2, 3))
    mine = np.empty((3, 3))
    for k in range(len(others)):
        other = others[k]
        for c in range(3):
            box[0, c] = min(other[0, c], other[1, c], other[2, c])
            box[1, c] = max(other[0, c], other[1, c], other[2, c])
        i0 = max(0, int(np.floor((box[0, 0] - low[0]) / cell)))
        i1 = min(nx - 1, int(np.floor((box[1, 0] - low[0]) / cell)))
        j0 = max(0, int(np.floor((box[0, 1] - low[1]) / cell)))
        j1 = min(ny - 1, int(np.floor((box[1, 1] - low[1]) / cell)))
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                at = i * ny + j
                for m in range(start[at], start[at + 1]):
                    meets = True
                    for c in range(3):
                        a = places[faces[members[m], 0], c]
                        b = places[faces[members[m], 1], c]
                        d = places[faces[members[m], 2], c]
                        mine[0, c], mine[1, c], mine[2, c] = a, b, d
                        if max(a, b, d) < box[0, c] or min(a, b, d) > box[1, c]:
                            meets = False
                            break
                    if meets and not _apart(mine, other):
                        return True
    return False
