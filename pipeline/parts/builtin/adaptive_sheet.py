"""Tessellating a curved sheet finely where it curves and coarsely where it doesn't."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.builtin.cell_error import all_rise, measure
from pipeline.parts.mesh.mending import halfedges

Points = NDArray[np.float64]
Sheet = Callable[[Points, Points], tuple[Points, Points]]
"""Maps square coordinates a, b (n,) to points (n, 3) of the outer and of the inner face, mm."""

_LATTICE = 1 << 20
_SAMPLES = 5
_CHUNK = 2048  # cells at a time: their points stay in the processor's cache
_MOST_CELLS = 400_000
_SLIMMEST = 6.0
_MOST_HANGING = 3


class TooFineError(ValueError):
    """The sheet can't be held to such small facets within a bounded number of them."""


def close_sheet(
    sheet: Sheet, *, facet_mm: float, start: int = 64
) -> tuple[Points, NDArray[np.int32], NDArray[np.int8], Points]:
    """Tessellate the sheet over the square [-1, 1]² and close it along its border.

    Cells are halved, each across the direction in which it bends more, until the triangles of
    both faces lie within `facet_mm` of their surface; neighbours may differ in size, and the
    larger cell takes up the vertices on its edges, so that no crack is left.

    Parameters
    ----------
    sheet
        The two faces of the sheet; outer normals point along d/da × d/db.
    facet_mm
        Largest distance between facets and surface, mm.
    start
        Number of cells along each side to begin with: no feature may be much smaller.

    Returns
    -------
    tuple
        (V, 3) vertices, mm; (F, 3) faces wound outward; (F,) 0 outer face, 1 inner face, 2
        border; and (F, 2) square coordinates of each face's middle.

    Raises
    ------
    TooFineError
        When that takes more than 400 000 cells.
    """
    size = _LATTICE // start
    low = np.arange(start) * size
    i, j = (grid.ravel() for grid in np.meshgrid(low, low, indexing="ij"))
    cells = np.stack([i, i + size, j, j + size], axis=1)
    cells = _graded(_refined(sheet, cells, facet_mm))
    lattice, faces = _triangles(sheet, cells)
    a, b = _square(lattice[:, 0]), _square(lattice[:, 1])
    outer, inner = sheet(a, b)
    count = len(lattice)
    directed, edge = halfedges(faces)
    p, q = directed[np.bincount(edge)[edge] == 1].T
    wall = np.concatenate(
        [np.stack([q, p, p + count], axis=1), np.stack([q, p + count, q + count], axis=1)]
    )
    side = np.repeat(np.array([0, 1, 2], dtype=np.int8), [len(faces), len(faces), len(wall)])
    solid = np.concatenate([faces, faces[:, ::-1] + count, wall]).astype(np.int32)
    middle = np.stack([a, b], axis=1)[solid % count].mean(axis=1)
    return np.concatenate([outer, inner]), solid, side, middle


def _square(lattice: NDArray[np.int64]) -> Points:
    return lattice.astype(np.float64) * (2.0 / _LATTICE) - 1.0


def _refined(sheet: Sheet, cells: NDArray[np.int64], facet_mm: float) -> NDArray[np.int64]:
    """Halve cells until their triangles lie within facet_mm of the sheet."""
    done: list[NDArray[np.int64]] = []
    total = 0
    while len(cells):
        parts = [cells[k : k + _CHUNK] for k in range(0, len(cells), _CHUNK)]
        halves: list[NDArray[np.int64]] = []
        for part in parts:
            error, across = _error(sheet, part)
            coarse = error > facet_mm
            done.append(part[~coarse])
            halves.append(_halved(part[coarse], across[coarse]))
            total += int((~coarse).sum())
        cells = np.concatenate(halves)
        if total + len(cells) > _MOST_CELLS:
            raise TooFineError(f"takes more than {_MOST_CELLS} cells")
    return np.concatenate(done)


def _halved(cells: NDArray[np.int64], across: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Both halves of each cell, cut in a where `across`, else in b; quarters on the diagonals.

    Sheets may be given in rings about the square's middle, whose corners then lie on smooth
    curves; cells there stay square, so that a diagonal of theirs runs along the square's.
    """
    a, b = cells[:, 0] + cells[:, 1], cells[:, 2] + cells[:, 3]
    square = (a == b) | (a + b == 2 * _LATTICE)
    halves = _cut(cells[~square], across[~square])
    every = np.ones(int(square.sum()), dtype=np.bool_)
    strips = _cut(cells[square], every)
    return np.concatenate([halves, _cut(strips, np.zeros(len(strips), dtype=np.bool_))])


def _cut(cells: NDArray[np.int64], across: NDArray[np.bool_]) -> NDArray[np.int64]:
    one, two = cells.copy(), cells.copy()
    for column, chosen in ((0, across), (2, ~across)):
        middle = (cells[chosen, column] + cells[chosen, column + 1]) // 2
        one[chosen, column + 1] = middle
        two[chosen, column] = middle
    return np.concatenate([one, two])


def _error(
    sheet: Sheet, cells: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Distance of each cell's two triangles from the sheet, and whether to cut in a."""
    share = np.linspace(0.0, 1.0, _SAMPLES)
    a = _square(cells[:, :1] + share * (cells[:, 1:2] - cells[:, :1]))
    b = _square(cells[:, 2:3] + share * (cells[:, 3:4] - cells[:, 2:3]))
    shape = (len(cells), _SAMPLES, _SAMPLES)
    grid_a = np.broadcast_to(a[:, :, None], shape).ravel()
    grid_b = np.broadcast_to(b[:, None, :], shape).ravel()
    error, bend, length = np.zeros(len(cells)), np.zeros((2, len(cells))), np.zeros((2, len(cells)))
    for points in sheet(grid_a, grid_b):
        measure(np.ascontiguousarray(points).reshape(*shape, 3), error, bend, length)
    across = bend[0] > bend[1]
    across = np.where(length[0] > _SLIMMEST * length[1], True, across)
    across = np.where(length[1] > _SLIMMEST * length[0], False, across)
    return error, across


def _vertices(
    cells: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Corners of all cells, sorted by (a, b) as keys, by (b, a) as keys, and their ranks there."""
    base = _LATTICE + 1
    corner = np.concatenate([cells[:, [i, j]] for i in (0, 1) for j in (2, 3)])
    keys = np.unique(corner[:, 0] * base + corner[:, 1])
    swapped = (keys % base) * base + keys // base
    order = np.argsort(swapped)
    return keys, swapped[order], order


def _edges(
    cells: NDArray[np.int64], keys: NDArray[np.int64], swapped: NDArray[np.int64]
) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """First and last vertex (rank) on the low-a, high-a, low-b and high-b edge of each cell."""
    base = _LATTICE + 1
    found = []
    for table, fixed, start in ((keys, 0, 2), (keys, 1, 2), (swapped, 2, 0), (swapped, 3, 0)):
        low = np.searchsorted(table, cells[:, fixed] * base + cells[:, start])
        high = np.searchsorted(table, cells[:, fixed] * base + cells[:, start + 1])
        found.append((low, high))
    return found


def _graded(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Halve cells that have too many vertices of their neighbours on an edge."""
    while True:
        keys, swapped, _ = _vertices(cells)
        left, right, below, above = (
            high - low - 1 for low, high in _edges(cells, keys, swapped)
        )
        in_b = np.maximum(left, right)
        in_a = np.maximum(below, above)
        coarse = np.maximum(in_a, in_b) > _MOST_HANGING
        if not coarse.any():
            return cells
        cells = np.concatenate([cells[~coarse], _halved(cells[coarse], (in_a > in_b)[coarse])])


def _triangles(
    sheet: Sheet, cells: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lattice points (V, 2) and triangles: two for a plain cell, else a fan about its middle."""
    base = _LATTICE + 1
    cells = cells[np.lexsort((cells[:, 2], cells[:, 0]))]
    keys, swapped, order = _vertices(cells)
    edges = _edges(cells, keys, swapped)
    plain = np.all([high - low == 1 for low, high in edges], axis=0)
    lattice = np.stack([keys // base, keys % base], axis=1)
    p00, p01 = edges[0][0][plain], edges[0][1][plain]
    p10, p11 = edges[1][0][plain], edges[1][1][plain]
    outer, _ = sheet(_square(lattice[:, 0]), _square(lattice[:, 1]))
    short = all_rise(outer[p00], outer[p10], outer[p01], outer[p11])
    one = np.where(short[:, None], np.stack([p00, p10, p11], 1), np.stack([p00, p10, p01], 1))
    two = np.where(short[:, None], np.stack([p00, p11, p01], 1), np.stack([p10, p11, p01], 1))
    fans = cells[~plain]
    centre = len(lattice) + np.arange(len(fans))
    middle = np.stack([(fans[:, 0] + fans[:, 1]) // 2, (fans[:, 2] + fans[:, 3]) // 2], axis=1)
    blocks = [one, two]
    for number, (low, high) in enumerate(edges):
        low, high = low[~plain], high[~plain]
        count = high - low
        step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        first = np.repeat(low, count) + step
        p, q = first, first + 1
        if number >= 2:
            p, q = order[p], order[q]
        if number in (0, 3):
            p, q = q, p
        blocks.append(np.stack([np.repeat(centre, count), p, q], axis=1))
    return np.concatenate([lattice, middle]), np.concatenate(blocks)
