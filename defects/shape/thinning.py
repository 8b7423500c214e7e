"""A grid of points joined by as few triangles as a tolerance allows: a right-triangulated network.

Each block of the grid is halved into right triangles, and these again at the middle of their
longest side, until the surface there keeps within the tolerance (Evans, Kirkpatrick, Townsend,
Right-triangulated irregular networks, Algorithmica 30 (2001) 264). A point that is needed needs
those by which it is reached, so triangles of different size meet without gaps.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]

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
        needed = self.needed(places_mm, tolerance_mm)
        return self.faces if needed is None else self.triangles(needed)

    def needed(
        self, places_mm: Floats, tolerance_mm: float, where: Bools | None = None
    ) -> Bools | None:
        """Return which places of the grid a surface needs; None: all, where no blocks fit.

        Parameters
        ----------
        places_mm, tolerance_mm
            See `thinned`.
        where
            (N,) the points that the tolerance holds for; None: all.

        Returns
        -------
        needed
            Rows and columns, those of rings with the first row once more. What a point needs is
            needed, too: so is it in each union and intersection of these sets.
        """
        node = self._closed
        block = self._block
        if block == 1 or tolerance_mm <= 0:
            return None
        held = np.ones(node.shape, np.bool_) if where is None else where[node]
        error = np.zeros(node.shape)
        places = places_mm.take(node, axis=0)
        _own_errors(places, block, tolerance_mm, self.hub is not None, held, error)
        _hand_up(error, block, self.hub is not None)
        found: Bools = error > tolerance_mm
        return found

    def reached(self, needed: Bools, where: Bools) -> Bools:
        """Return the needed places at points `where` (N,), and those by which they are reached."""
        error = np.where(needed & where[self._closed], 1.0, 0.0)
        _hand_up(error, self._block, self.hub is not None)
        found: Bools = error > 0
        return found

    def triangles(self, needed: Bools) -> Ints:
        """Return the triangles (k, 3) of the places that `needed` returned."""
        return self.apart(needed, needed)[0]

    def apart(self, needed: Bools, others: Bools) -> tuple[Ints, Bools]:
        """Return the triangles of the needed places and which of them others don't have.

        Returns
        -------
        faces, own
            (k, 3), and (k,) where the triangles of the places `others` are different ones; the
            triangles around a hub count as the same.
        """
        node = self._closed
        found, own = _triangles(needed, others, self._block)
        faces: Ints = node.ravel().take(found)
        if self.hub is None:
            return faces, own
        kept = np.zeros(int(node.max()) + 1, np.bool_)
        kept[faces] = True
        ring = node[:, 0]
        fan = self._fan(ring[kept[ring]])
        return (
            np.concatenate([fan, faces[:, ::-1]]),
            np.concatenate([np.zeros(len(fan), np.bool_), own]),
        )

    @property
    def _block(self) -> int:
        """Return the cells along a block's side; 1: none larger fits."""
        most = len(self.node) // LEAST_SECTORS if self.hub is not None else BLOCKS[0]
        shape = self._closed.shape
        fitting = [b for b in BLOCKS if b <= most and not any((k - 1) % b for k in shape)]
        return fitting[0] if fitting else 1

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


@njit(cache=True)
def _own_errors(
    places: Floats, block: int, tolerance_mm: float, rings: bool, held: Bools, error: Floats
) -> None:
    """Write how far each point (n, m) that is held lies from the middle of the side it halves.

    Along the normal; sideways, the tolerance is a share of the triangle's height.
    """
    n, m = places.shape[:2]
    for i in range(n):
        for j in range(m):
            if not held[i, j] or (i % block == 0 and j % block == 0):
                continue
            half = 1
            while i // half % 2 == 0 and j // half % 2 == 0:
                half *= 2
            down, right = i // half % 2 * half, j // half % 2 * half
            if down and right and (i // (2 * half) + j // (2 * half)) % 2:
                right = -half
            error[i, j] = _own_error(places, i, j, down, right, tolerance_mm, rings)


@njit(cache=True)
def _hand_up(error: Floats, block: int, rings: bool) -> None:
    """Give each point (n, m) the greatest error of those that it leads to."""
    n, m = error.shape
    half = 1
    while half < block:
        side, quarter = 2 * half, half // 2
        for i in range(0, n, half):
            for j in range((i // half + 1) % 2 * half, m, side):
                if quarter:
                    for a in (-quarter, quarter):
                        for b in (-quarter, quarter):
                            if 0 <= i + a < n and 0 <= j + b < m:
                                error[i, j] = max(error[i, j], error[i + a, j + b])
        if rings:
            for j in range(m):
                error[0, j] = error[n - 1, j] = max(error[0, j], error[n - 1, j])
        for i in range(half, n, side):
            for j in range(half, m, side):
                own = max(error[i, j], error[i - half, j], error[i + half, j])
                error[i, j] = max(own, error[i, j - half], error[i, j + half])
        half = side


@njit(cache=True)
def _own_error(
    places: Floats, i: int, j: int, down: int, right: int, tolerance_mm: float, rings: bool
) -> float:
    """Return how far a point is from the middle of the two ends `down` and `right` from it."""
    n, m = places.shape[:2]
    above, below, span = max(i - 1, 0), min(i + 1, n - 1), 2
    if rings and (i == 0 or i == n - 1):
        above, below = n - 2, 1
    else:
        span = below - above
    before, after = max(j - 1, 0), min(j + 1, m - 1)
    ax = (places[below, j, 0] - places[above, j, 0]) / span
    ay = (places[below, j, 1] - places[above, j, 1]) / span
    az = (places[below, j, 2] - places[above, j, 2]) / span
    cx = (places[i, after, 0] - places[i, before, 0]) / (after - before)
    cy = (places[i, after, 1] - places[i, before, 1]) / (after - before)
    cz = (places[i, after, 2] - places[i, before, 2]) / (after - before)
    nx, ny, nz = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx
    area = np.sqrt(nx * nx + ny * ny + nz * nz)
    own = square = length = skew = 0.0
    for c in range(3):
        one, other = places[i + down, j + right, c], places[i - down, j - right, c]
        off, way = (one + other) / 2 - places[i, j, c], (one - other) / 2
        own += off * (nx, ny, nz)[c] / max(area, 1e-300)
        square += way * way
        length += off * off
        skew += off * way
    own, square = abs(own), max(square, 1e-300)
    beside = length - own * own - skew * skew / square
    # over the triangle's height, which is the cells' area over the side's half
    half = max(down, abs(right))
    share = np.sqrt(max(beside, 0.0) * square) / (half * half * area + 1e-300)
    return float(max(own, tolerance_mm / SKEW * share))


def _triangles(needed: Bools, others: Bools, block: int) -> tuple[Ints, Bools]:
    """Return the triangles (k, 3) of the points needed, by their places in the flattened grid.

    And which of them the triangles of other points don't have.
    """
    n, m = needed.shape
    i, j = (index.ravel() for index in np.mgrid[0 : n - 1 : block, 0 : m - 1 : block])
    low, right = i * m + j, i * m + j + block
    up, far = low + block * m, right + block * m
    odd = ((i + j) // block % 2).astype(np.bool_)
    # Both halves of a square: the ends of the longest side, then the right angle.
    start, end = np.where(odd, up, low), np.where(odd, right, far)
    count = 2 * len(low)
    most = count + 2 * int(np.count_nonzero(needed))  # a point halves two triangles at most
    now, after, found = np.zeros((3, most, 4), np.int32)
    now[:count, 0], now[:count, 1] = np.concatenate([start, end]), np.concatenate([end, start])
    now[:count, 2] = np.concatenate([np.where(odd, low, right), np.where(odd, far, up)])
    halvings = 2 * (block.bit_length() - 1)
    made = _halve(needed.ravel(), others.ravel(), count, halvings, now, after, found)
    return found[:made, :3], found[:made, 3] > 0


@njit(cache=True)
def _halve(
    needed: Bools, others: Bools, count: int, halvings: int, now: Ints, after: Ints, found: Ints
) -> int:
    """Halve the first triangles `now` at needed points; write those that stay, return how many.

    A row holds a triangle's places and whether it is none of the others' triangles.
    """
    made = 0
    for level in range(halvings + 1):
        split = 0
        for k in range(count):
            if level < halvings and needed[(now[k, 0] + now[k, 1]) // 2]:
                split += 1
        at = 0
        for k in range(count):
            a, b, c, own = now[k, 0], now[k, 1], now[k, 2], now[k, 3]
            middle = (a + b) // 2
            if level < halvings and needed[middle]:
                own = max(own, 1 - others[middle])
                after[at, 0], after[at, 1], after[at, 2], after[at, 3] = c, a, middle, own
                other = at + split
                after[other, 0], after[other, 1] = b, c
                after[other, 2], after[other, 3] = middle, own
                at += 1
            else:
                if level < halvings and others[middle]:
                    own = 1
                found[made, 0], found[made, 1], found[made, 2], found[made, 3] = a, b, c, own
                made += 1
        now, after = after, now
        count = 2 * split
    return made


def _quads(here: Ints, there: Ints) -> Ints:
    """Join two rows (k, r) of node numbers, the second to the left of the first, by triangles."""
    a, b = here[:, :-1].ravel(), here[:, 1:].ravel()
    c, d = there[:, 1:].ravel(), there[:, :-1].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
