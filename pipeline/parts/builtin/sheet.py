"""Closing two facing grids of points (a sheet's top and underside) into a solid of triangles."""

from __future__ import annotations

import manifold3d
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


def close_tube(
    rings: NDArray[np.float64], ends: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Close a tube of points into a solid, whichever way it was drawn.

    Parameters
    ----------
    rings
        (m, n, 3) points, mm: m points around, n along.
    ends
        Heights z, on the axis x = y = 0, of the two points to which the ends are drawn
        together; without them the ends are plane and any simple polygon.

    Returns
    -------
    tuple
        (V, 3) vertices and (F, 3) faces wound outward.
    """
    m, n = rings.shape[:2]
    number = np.arange(m * n).reshape(m, n)
    around = np.concatenate([number, number[:1]])
    closed = np.concatenate([rings, rings[:1]])
    vertices = rings.reshape(-1, 3)
    blocks = [_quads(around, diagonal=_shorter(closed))]
    for end, column in enumerate((0, n - 1)):
        if ends is None:
            cap = number[_polygon(rings[:, column]), column]
            # The polygon's own way round agrees with the tube's at one of its ends only.
            blocks.append(_against(cap, around[:, column], tail=end == 1))
        else:
            vertices = np.concatenate([vertices, [[0.0, 0.0, ends[end]]]])
            tip = np.full(m, len(vertices) - 1)
            a, b = around[:-1, column], around[1:, column]
            fan = np.stack([tip, b, a] if end == 0 else [tip, a, b], axis=1)
            blocks.append(fan)
    faces = np.concatenate(blocks)
    corners = vertices[faces]
    signed = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return vertices, faces if signed > 0.0 else faces[:, ::-1]


def _polygon(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles of a plane polygon in space, in its two widest coordinates."""
    wide = np.sort(np.argsort(np.ptp(points, axis=0))[1:])
    flat = points[:, wide]
    x, y = flat.T
    way = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    order = np.arange(len(flat)) if way > 0.0 else np.arange(len(flat))[::-1]
    found = np.asarray(manifold3d.triangulate([np.ascontiguousarray(flat[order])]), dtype=np.int64)
    return np.asarray(order[found])


def _against(
    faces: NDArray[np.int64], ring: NDArray[np.int64], tail: bool
) -> NDArray[np.int64]:
    """Wind a cap against the tube's side, whose faces run along the ring at its tail."""
    step = {(int(a), int(b)) for a, b in zip(ring[:-1], ring[1:], strict=True)}
    along = any(
        (int(face[k]), int(face[(k + 1) % 3])) in step for face in faces for k in range(3)
    )
    # The side's quads a, b, c, d run a -> b (along the ring) in the first column, c -> d
    # (against it) in the last.
    return faces if along == tail else faces[:, ::-1]
