"""Closing two facing grids of points (a sheet's top and underside) into a solid of triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def close_grid(
    top: NDArray[np.float64], bottom: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int8]]:
    """Triangulate the solid between two grids of points.

    Parameters
    ----------
    top, bottom
        (m, n, 3) points, mm; rows run along x, columns along y, top above bottom.

    Returns
    -------
    tuple
        (V, 3) vertices, (F, 3) faces wound outward, and (F,) the side each face is on: 0 top,
        1 bottom, 2 low x, 3 high x, 4 low y, 5 high y.
    """
    m, n = top.shape[:2]
    number = np.arange(2 * m * n).reshape(2, m, n)
    above, below = number
    blocks = [
        _quads(above, diagonal=_shorter(top)),
        _quads(below, diagonal=_shorter(bottom))[:, ::-1],
        _quads(np.stack([above[0], below[0]], axis=0))[:, ::-1],
        _quads(np.stack([above[-1], below[-1]], axis=0)),
        _quads(np.stack([above[:, 0], below[:, 0]], axis=0)),
        _quads(np.stack([above[:, -1], below[:, -1]], axis=0))[:, ::-1],
    ]
    faces = np.concatenate(blocks).astype(np.int32)
    side = np.repeat(np.arange(6, dtype=np.int8), [len(block) for block in blocks])
    return np.concatenate([top.reshape(-1, 3), bottom.reshape(-1, 3)]), faces, side


def _shorter(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where the diagonal from (i, j) to (i + 1, j + 1) is not the longer one."""
    first = np.linalg.norm(points[1:, 1:] - points[:-1, :-1], axis=-1)
    second = np.linalg.norm(points[1:, :-1] - points[:-1, 1:], axis=-1)
    return np.asarray(first <= second * (1.0 + 1e-9))


def _quads(
    number: NDArray[np.int64], diagonal: NDArray[np.bool_] | None = None
) -> NDArray[np.int64]:
    """Two triangles a cell, counter-clockwise where rows run along x and columns along y."""
    a, b = number[:-1, :-1].ravel(), number[1:, :-1].ravel()
    c, d = number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    first = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1)
    if diagonal is None:
        return first.reshape(-1, 3)
    second = np.stack([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)], axis=1)
    return np.where(diagonal.ravel()[:, None, None], first, second).reshape(-1, 3)
