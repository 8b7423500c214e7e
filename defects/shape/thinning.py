"""A grid of points joined by as few triangles as a tolerance allows: a right-triangulated network.

Each block of the grid is halved into right triangles, and these again at the middle of their
longest side, until the surface there keeps within the tolerance (Evans, Kirkpatrick, Townsend,
Right-triangulated irregular networks, Algorithmica 30 (2001) 264). A point that is needed needs
those by which it is reached, so triangles of different size meet without gaps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

BLOCKS = (16, 8, 4, 2)  # cells along a block's side, the best first
LEAST_SECTORS = 8  # of a ring
SKEW = 0.5  # of a triangle's height: how far a side may run beside the point that it replaces
WASTE = 0.15  # share of further points for which larger blocks are worth it


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Grid:
    """Numbers of points in rows and columns.

    Parameters
    ----------
    node
        (n, m) int32.
    hub
        A point within the rows, which close to rings then; None: an open strip. Strips face the
        side from which columns lie to the left of rows, rings the other one.
    """

    node: Ints
    hub: int | None = None

    @property
    def faces(self) -> Ints:
        """Return the triangles (k, 3), all cells halved."""
        if self.hub is None:
            return _quads(self.node[1:], self.node[:-1])
        return np.concatenate([self._fan(self._closed[:, 0]), _quads(self.node, self._closed[1:])])

    @property
    def rim(self) -> Ints:
        """Return the outer points (k,) in the order in which the faces walk them."""
        node = self.node
        if self.hub is not None:
            return node[:, -1]
        return np.concatenate([node[:-1, 0], node[-1, :-1], node[:0:-1, -1], node[0, :0:-1]])

    @property
    def _closed(self) -> Ints:
        """Return the numbers, of rings with the first row at the end once more."""
        return self.node if self.hub is None else np.concatenate([self.node, self.node[:1]])

    def _fan(self, ring: Ints) -> Ints:
        return np.stack([np.full(len(ring) - 1, self.hub, np.int32), ring[:-1], ring[1:]], axis=1)

    def thinned(self, places_mm: Floats, tolerance_mm: float) -> Ints:
        """Return triangles (k, 3) that pass all points within a tolerance.

        Parameters
        ----------
        places_mm
            (N, 3) the surface's points, by number.
        tolerance_mm
            Greatest distance, along the normal, of a point that is left out from the middle of the
            side it halves. Over all halvings of a smooth surface that makes 4/3 of it.
        """
        node = self._closed
        most = len(self.node) // LEAST_SECTORS if self.hub is not None else BLOCKS[0]
        fitting = [b for b in BLOCKS if b <= most and not any((k - 1) % b for k in node.shape)]
        block = fitting[0] if fitting else 1
        if block == 1 or tolerance_mm <= 0:
            return self.faces
        error = _errors(places_mm[node], block, tolerance_mm, rings=self.hub is not None)
        faces = node.ravel()[_triangles(error > tolerance_mm, block)]
        if self.hub is None:
            return faces
        kept = np.zeros(len(places_mm), np.bool_)
        kept[faces] = True
        ring = node[:, 0]
        return np.concatenate([self._fan(ring[kept[ring]]), faces[:, ::-1]])

    def stand_ins(self, faces: Ints, count: int) -> Ints:
        """Return for each rim point the last one up to it that faces have; others stay (count,)."""
        used = np.zeros(count, np.bool_)
        used[faces] = True
        rim = self.rim
        place = np.maximum.accumulate(np.where(used[rim], np.arange(len(rim)), -1))
        found = np.arange(count, dtype=np.int32)
        found[rim] = rim[np.where(place < 0, place.max(), place)]
        return found


def filled(positions: Floats, beyond: int = 0) -> Floats:
    """Return rising positions, the widest gaps halved until their number suits large blocks.

    Parameters
    ----------
    positions
        (n,) above 0, where the first gap begins.
    beyond
        By how many the number is to exceed a multiple of a block's side.
    """
    found = np.asarray(positions, np.float64)
    lacking = next(
        k for b in (*BLOCKS, 1) if (k := (beyond - len(found)) % b) <= WASTE * len(found)
    )
    while lacking:
        gaps = np.diff(found, prepend=0.0)
        widest = np.sort(np.argsort(-gaps, kind="stable")[:lacking])
        found = np.insert(found, widest, found[widest] - gaps[widest] / 2)
        lacking -= len(widest)
    return found


def _errors(places: Floats, block: int, tolerance_mm: float, *, rings: bool) -> Floats:
    """Return how far each point (n, m) is from the side that it halves, or any that it leads to.

    Along the normal; sideways, the tolerance is a share of the triangle's height.
    """
    n, m = places.shape[:2]
    along: Floats = np.gradient(places, axis=0)
    across: Floats = np.gradient(places, axis=1)
    if rings:
        along[0] = along[-1] = (places[1] - places[-2]) / 2
    normals = np.cross(along, across)
    area = np.sqrt(np.einsum("ijk,ijk->ij", normals, normals))
    normals /= np.maximum(area, 1e-300)[..., None]
    error = np.zeros((n + 2 * block, m + 2 * block))  # with a border, where nothing is
    inner = error[block:-block, block:-block]

    def measure(
        start: tuple[int, int],
        step: tuple[int, int],
        end: tuple[int, int],
        leads: list[tuple[int, int]],
    ) -> None:
        """Hold points from `start` on against the middle of their ends and what they lead to."""
        count = [len(range(start[k], (n, m)[k], step[k])) for k in (0, 1)]
        if not all(count):
            return

        def at(i: int, j: int) -> tuple[slice, slice]:
            begin = start[0] + i, start[1] + j
            return (
                slice(begin[0], begin[0] + (count[0] - 1) * step[0] + 1, step[0]),
                slice(begin[1], begin[1] + (count[1] - 1) * step[1] + 1, step[1]),
            )

        here = at(0, 0)
        one, other = places[at(*end)], places[at(-end[0], -end[1])]
        off, way = (one + other) / 2 - places[here], (one - other) / 2
        own = np.abs(np.einsum("ijk,ijk->ij", off, normals[here]))
        square = np.maximum(np.einsum("ijk,ijk->ij", way, way), 1e-300)
        beside = np.einsum("ijk,ijk->ij", off, off) - own**2
        beside -= np.einsum("ijk,ijk->ij", off, way) ** 2 / square
        # over the triangle's height, which is the cells' area over the side's half
        share = np.sqrt(np.maximum(beside, 0) * square) / (max(end) ** 2 * area[here] + 1e-300)
        np.maximum(own, tolerance_mm / SKEW * share, out=own)
        for i, j in leads:
            np.maximum(own, error[at(i + block, j + block)], out=own)
        inner[here] = own

    half = 1
    while half < block:
        side, quarter = 2 * half, half // 2
        diagonal = [(a, b) for a in (-quarter, quarter) for b in (-quarter, quarter) if quarter]
        straight = [(half, 0), (-half, 0), (0, half), (0, -half)]
        measure((0, half), (side, side), (0, half), diagonal)
        measure((half, 0), (side, side), (half, 0), diagonal)
        if rings:
            inner[0] = inner[-1] = np.maximum(inner[0], inner[-1])
        for k in (0, 1):
            first, second = half + k * side, half + (1 - k) * side
            measure((first, first), (2 * side, 2 * side), (half, half), straight)
            measure((first, second), (2 * side, 2 * side), (half, -half), straight)
        half = side
    return inner


def _triangles(needed: NDArray[np.bool_], block: int) -> NDArray[np.int64]:
    """Return the triangles (k, 3) of the points needed, by their places in the flattened grid."""
    n, m = needed.shape
    i, j = (index.ravel() for index in np.mgrid[0 : n - 1 : block, 0 : m - 1 : block])
    low, right = i * m + j, i * m + j + block
    up, far = low + block * m, right + block * m
    odd = ((i + j) // block % 2).astype(np.bool_)
    # Both halves of a square: the ends of the longest side, then the right angle.
    start, end = np.where(odd, up, low), np.where(odd, right, far)
    a, b = np.concatenate([start, end]), np.concatenate([end, start])
    c = np.concatenate([np.where(odd, low, right), np.where(odd, far, up)])
    flat, done = needed.ravel(), []
    for _ in range(2 * (block.bit_length() - 1)):
        middle = (a + b) // 2
        split = flat[middle]
        done.append(np.stack([a, b, c], axis=1)[~split])
        a, b, c, middle = a[split], b[split], c[split], middle[split]
        a, b, c = np.concatenate([c, b]), np.concatenate([a, c]), np.concatenate([middle, middle])
    return np.concatenate([*done, np.stack([a, b, c], axis=1)])


def _quads(here: Ints, there: Ints) -> Ints:
    """Join two rows (k, r) of node numbers, the second to the left of the first, by triangles."""
    a, b = here[:, :-1].ravel(), here[:, 1:].ravel()
    c, d = there[:, 1:].ravel(), there[:, :-1].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
