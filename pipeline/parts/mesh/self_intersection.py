"""Finding triangles of a mesh that cross each other: a tree of boxes, then pair by pair."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.mesh.triangle_pairs import cross, straddling

CHUNK = 400_000  # pairs at a time
MOST_PAIRS: Final = 60_000_000
"""Pairs of faces that are looked at: half a minute."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Crossings:
    """Pairs of faces that cross, where, whether these are all, and whether the budget ran out."""

    pairs: NDArray[np.int64]
    points_mm: NDArray[np.float64]
    complete: bool
    over_budget: bool


def crossings(
    vertices_mm: NDArray[np.float64],
    faces: NDArray[np.integer],
    *,
    tolerance_mm: float,
    most: int = 20_000,
) -> Crossings:
    """Pairs of triangles of which an edge of one runs through the other.

    An edge counts when its ends lie on opposite sides of the other triangle, both farther than
    the tolerance from its plane, and it meets the triangle farther than the tolerance from its
    border. So contact (shared vertices and edges, coplanar faces, bodies standing on each other)
    is no crossing, and neither is overlap shallower than the rounding of the file.

    Parameters
    ----------
    vertices_mm, faces
        (V, 3) and (F, 3).
    tolerance_mm
        Depth up to which an overlap is taken for contact, mm.
    most
        Stop after about so many crossing pairs. The work itself is bounded too: `MOST_PAIRS` of
        overlapping boxes.
    """
    corners = vertices_mm[faces]
    levels, order = _boxes(corners, tolerance_mm)
    depth = len(levels) - 1
    found: list[NDArray[np.int64]] = []
    where: list[NDArray[np.float64]] = []
    count, looked, complete, over_budget = 0, 0, True, False
    stack = [(0, np.zeros((1, 2), dtype=np.int64))]
    while stack:
        level, pairs = stack.pop()
        if len(pairs) > CHUNK:
            half = len(pairs) // 2
            stack += [(level, pairs[half:]), (level, pairs[:half])]
            continue
        if level < depth:
            below = _overlapping(levels[level + 1], _children(pairs))
            if len(below):
                stack.append((level + 1, below))
            continue
        looked += len(pairs)
        real = order[pairs]
        real = real[(real >= 0).all(axis=1) & (real[:, 0] != real[:, 1])]
        real = real[straddling(corners, real, tolerance_mm)]
        hit, point = cross(corners, real, tolerance_mm)
        if hit.any():
            found.append(np.sort(real[hit], axis=1))
            where.append(point[hit])
            count += int(hit.sum())
        if count >= most or looked > MOST_PAIRS:
            complete = not stack
            over_budget = not complete and looked > MOST_PAIRS
            break
    if not found:
        return Crossings(
            pairs=np.empty((0, 2), dtype=np.int64), points_mm=np.empty((0, 3)),
            complete=complete, over_budget=over_budget,
        )  # fmt: skip
    pairs, points = np.concatenate(found), np.concatenate(where)
    rank = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return Crossings(
        pairs=pairs[rank], points_mm=points[rank], complete=complete, over_budget=over_budget
    )


def _boxes(
    corners: NDArray[np.float64], margin: float
) -> tuple[list[NDArray[np.float64]], NDArray[np.int64]]:
    """Complete binary tree of boxes over the faces in Morton order; padding boxes are empty."""
    low, high = corners.min(axis=1) - margin, corners.max(axis=1) + margin
    centre = (low + high) / 2.0
    span = np.maximum(centre.max(axis=0) - centre.min(axis=0), 1e-300)
    grid = ((centre - centre.min(axis=0)) / span * 1023.0).astype(np.int64)
    code = np.zeros(len(corners), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((grid[:, axis] >> bit) & 1) << (3 * bit + axis)
    rank = np.argsort(code, kind="stable")
    size = 1 << int(np.ceil(np.log2(max(len(corners), 2))))
    order = np.full(size, -1, dtype=np.int64)
    order[: len(rank)] = rank
    box = np.full((size, 2, 3), np.inf)
    box[:, 1] = -np.inf
    box[: len(rank), 0], box[: len(rank), 1] = low[rank], high[rank]
    levels = [box]
    while len(levels[-1]) > 1:
        pair = levels[-1].reshape(-1, 2, 2, 3)
        levels.append(np.stack([pair[:, :, 0].min(axis=1), pair[:, :, 1].max(axis=1)], axis=1))
    return levels[::-1], order


def _children(pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs of children of pairs of nodes, each unordered pair once."""
    first, second = 2 * pairs[:, 0], 2 * pairs[:, 1]
    below = np.stack(
        [
            np.stack([first, second], axis=1),
            np.stack([first, second + 1], axis=1),
            np.stack([first + 1, second], axis=1),
            np.stack([first + 1, second + 1], axis=1),
        ],
        axis=1,
    )
    keep = np.ones((len(pairs), 4), dtype=np.bool_)
    keep[:, 2] = pairs[:, 0] != pairs[:, 1]
    return np.asarray(below[keep])


def _overlapping(box: NDArray[np.float64], pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs of nodes whose boxes overlap, looked at one axis after the other."""
    for axis in range(3):
        low, high = box[:, 0, axis], box[:, 1, axis]
        one, other = pairs[:, 0], pairs[:, 1]
        pairs = pairs[(low[one] <= high[other]) & (low[other] <= high[one])]
    return pairs
