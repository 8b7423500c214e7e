"""Rays against a triangle mesh: a bounding-volume tree in double precision.

The virtual instrument has its own caster so that an error in another one cannot hide in both.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

_LEAF = 4
_EDGE = 1e-9  # barycentric slack, so that a ray on a shared edge is never lost


class Tree(NamedTuple):
    """A mesh ready for casting.

    Attributes
    ----------
    corner, edge_1, edge_2, normal : (F, 3)
        First corner in mm, the two edges from it, outward unit normal; in leaf order.
    box : (N, 6)
        Lower and upper corner of each node.
    child : (N, 2)
        Children of an inner node; ``(-first - 1, count)`` of a leaf.
    """

    corner: NDArray[np.float64]
    edge_1: NDArray[np.float64]
    edge_2: NDArray[np.float64]
    normal: NDArray[np.float64]
    box: NDArray[np.float64]
    child: NDArray[np.int64]


@njit(cache=True)
def _build(
    low: NDArray[np.float64], high: NDArray[np.float64], centre: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Split at the median of the longest axis until leaves are small."""
    count = centre.shape[0]
    order = np.arange(count)
    box = np.empty((2 * count + 1, 6))
    child = np.zeros((2 * count + 1, 2), np.int64)
    stack = np.empty((128, 3), np.int64)
    stack[0] = (0, 0, count)
    depth, nodes = 1, 1
    while depth > 0:
        depth -= 1
        node, begin, end = stack[depth]
        for axis in range(3):
            box[node, axis] = np.inf
            box[node, axis + 3] = -np.inf
        middle_low = np.full(3, np.inf)
        middle_high = np.full(3, -np.inf)
        for i in range(begin, end):
            for axis in range(3):
                t = order[i]
                box[node, axis] = min(box[node, axis], low[t, axis])
                box[node, axis + 3] = max(box[node, axis + 3], high[t, axis])
                middle_low[axis] = min(middle_low[axis], centre[t, axis])
                middle_high[axis] = max(middle_high[axis], centre[t, axis])
        if end - begin <= _LEAF:
            child[node] = (-begin - 1, end - begin)
            continue
        axis = int(np.argmax(middle_high - middle_low))
        part = order[begin:end].copy()
        order[begin:end] = part[np.argsort(centre[part, axis])]
        half = (begin + end) // 2
        child[node] = (nodes, nodes + 1)
        stack[depth] = (nodes, begin, half)
        stack[depth + 1] = (nodes + 1, half, end)
        depth += 2
        nodes += 2
    return order, box[:nodes].copy(), child[:nodes].copy()


def plant(vertices_mm: NDArray[np.float64], faces: NDArray[np.int64]) -> Tree:
    """Build the tree of a mesh.

    Parameters
    ----------
    vertices_mm : (V, 3)
    faces : (F, 3)

    Returns
    -------
    Tree
    """
    corners = np.asarray(vertices_mm, np.float64)[np.asarray(faces)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    corners, cross = corners[length > 0], cross[length > 0] / length[length > 0, None]
    order, box, child = _build(corners.min(1), corners.max(1), corners.mean(1))
    corners, cross = corners[order], cross[order]
    return Tree(
        corner=np.ascontiguousarray(corners[:, 0]),
        edge_1=np.ascontiguousarray(corners[:, 1] - corners[:, 0]),
        edge_2=np.ascontiguousarray(corners[:, 2] - corners[:, 0]),
        normal=np.ascontiguousarray(cross),
        box=box,
        child=child,
    )


@njit(cache=True)
def nearest(
    tree: Tree,
    origin: tuple[float, float, float],
    direction: tuple[float, float, float],
    near: float,
    far: float,
    any_hit: bool,
) -> tuple[float, int]:
    """Nearest (or, with `any_hit`, some) triangle along one ray between `near` and `far`.

    Returns
    -------
    distance : float
        In units of the direction's length; ``inf`` where nothing is hit.
    triangle : int
        Index in leaf order, -1 for none.
    """
    corner, edge_1, edge_2, _, box, child = tree
    ox, oy, oz = origin
    dx, dy, dz = direction
    tiny = 1e-300
    ix = 1.0 / (dx if dx != 0.0 else tiny)
    iy = 1.0 / (dy if dy != 0.0 else tiny)
    iz = 1.0 / (dz if dz != 0.0 else tiny)
    best, which = far, -1
    stack = np.empty(96, np.int64)
    stack[0] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        ax, bx = (box[node, 0] - ox) * ix, (box[node, 3] - ox) * ix
        ay, by = (box[node, 1] - oy) * iy, (box[node, 4] - oy) * iy
        az, bz = (box[node, 2] - oz) * iz, (box[node, 5] - oz) * iz
        enter = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), near))
        leave = min(min(max(ax, bx), max(ay, by)), min(max(az, bz), best))
        if enter > leave * (1 + 1e-12) + 1e-12:
            continue
        if child[node, 0] >= 0:
            stack[depth], stack[depth + 1] = child[node, 0], child[node, 1]
            depth += 2
            continue
        first = -child[node, 0] - 1
        for t in range(first, first + child[node, 1]):
            e1x, e1y, e1z = edge_1[t, 0], edge_1[t, 1], edge_1[t, 2]
            e2x, e2y, e2z = edge_2[t, 0], edge_2[t, 1], edge_2[t, 2]
            px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
            det = e1x * px + e1y * py + e1z * pz
            if det == 0.0:
                continue
            inv = 1.0 / det
            sx, sy, sz = ox - corner[t, 0], oy - corner[t, 1], oz - corner[t, 2]
            u = (sx * px + sy * py + sz * pz) * inv
            if u < -_EDGE or u > 1.0 + _EDGE:
                continue
            qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
            v = (dx * qx + dy * qy + dz * qz) * inv
            if v < -_EDGE or u + v > 1.0 + _EDGE:
                continue
            distance = (e2x * qx + e2y * qy + e2z * qz) * inv
            if near < distance < best:
                best, which = distance, t
                if any_hit:
                    return best, which
    if which < 0:
        return np.inf, -1
    return best, which
