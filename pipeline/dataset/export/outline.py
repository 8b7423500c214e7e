"""Outlines of labelled points: along the points' borders, so that filling them gives them back."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes, label

Polygon = list[tuple[int, int]]  # (x, y), corners of points: point (row 0, column 0) is 0..1
SIDES = (  # neighbour (dy, dx); where the border to it starts and ends, the point on its right
    (-1, 0, (0, 0), (1, 0)),
    (0, 1, (1, 0), (1, 1)),
    (1, 0, (1, 1), (0, 1)),
    (0, -1, (0, 1), (0, 0)),
)


def outline(here: NDArray[np.bool_]) -> Polygon:
    """One closed polygon round all points that are set, holes filled.

    It runs along the borders between points, so even a single point has four corners. Pieces that
    don't touch are joined by a bridge without width between their nearest corners.
    """
    rows, columns = np.nonzero(here)
    top, left = int(rows.min()), int(columns.min())
    crop = here[top : rows.max() + 1, left : columns.max() + 1]
    filled = np.pad(binary_fill_holes(crop), 1)
    pieces, count = label(filled)
    whole: Polygon = []
    for piece in range(1, count + 1):
        whole = _joined(whole, _around(pieces == piece))
    return [(x + left - 1, y + top - 1) for x, y in whole]


def _around(piece: NDArray[np.bool_]) -> Polygon:
    """Corners round one 4-connected piece, straight runs left out.

    Holes are filled as seen by background that is 4-connected, so a piece doesn't touch itself at
    a corner and each corner has one that follows.
    """
    follows: dict[tuple[int, int], tuple[int, int]] = {}
    inner = piece[1:-1, 1:-1]
    height, width = piece.shape
    for dy, dx, start, end in SIDES:
        beside = piece[1 + dy : height - 1 + dy, 1 + dx : width - 1 + dx]
        for y, x in (np.argwhere(inner & ~beside) + 1).tolist():
            follows[x + start[0], y + start[1]] = (x + end[0], y + end[1])
    chain: Polygon = [min(follows)]
    while (at := follows[chain[-1]]) != chain[0]:
        chain.append(at)
    before, after = [chain[-1], *chain[:-1]], [*chain[1:], chain[0]]
    return [here for b, here, a in zip(before, chain, after, strict=True) if _turn(b, here, a)]


def _turn(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> int:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _joined(one: Polygon, other: Polygon) -> Polygon:
    """Join two closed polygons by a bridge there and back between their nearest corners."""
    if not one:
        return other
    gaps = np.array(one)[:, None, :] - np.array(other)[None, :, :]
    i, j = np.unravel_index(int(np.argmin((gaps**2).sum(axis=2))), (len(one), len(other)))
    return [*one[: i + 1], *other[j:], *other[: j + 1], *one[i:]]
