"""Nearest point of a triangle mesh: a tree of boxes, compiled, in double precision."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

LEAF = 4
"""Largest number of triangles in a leaf of the tree."""


@njit(cache=True, inline="always")
def _select(order: NDArray[np.int32], key: NDArray[np.float64], lo: int, hi: int, k: int) -> None:
    """Partly sort `order[lo:hi]` by `key` so that position `k` holds what it would in order."""
    hi -= 1
    while lo < hi:
        pivot = key[order[(lo + hi) // 2]]
        i, j = lo, hi
        while i <= j:
            while key[order[i]] < pivot:
                i += 1
            while key[order[j]] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if k <= j:
            hi = j
        elif k >= i:
            lo = i
        else:
            return


@njit(cache=True)
def build_tree(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int32]]:
    """Build a tree of boxes over the triangles by median splits of their centres.

    Parameters
    ----------
    vertices
        (V, 3), mm.
    faces
        (F, 3).

    Returns
    -------
    order
        (F,) triangles in the order of the leaves.
    box
        (N, 6) least and greatest corner of each node.
    node
        (N, 3) first child (-1 in a leaf; the second child follows it), first and one past the
        last position in `order`.
    """
    count = len(faces)
    order = np.empty(count, np.int32)
    centre = np.empty((3, count))
    for f in range(count):
        order[f] = f
        for c in range(3):
            centre[c, f] = (
                vertices[faces[f, 0], c] + vertices[faces[f, 1], c] + vertices[faces[f, 2], c]
            )
    size = max(1, 2 * count)
    box = np.empty((size, 6))
    node = np.empty((size, 3), np.int32)
    node[0, 1], node[0, 2] = 0, count
    low, high = np.empty(3), np.empty(3)
    used = 1
    at = 0
    while at < used:
        start, stop = node[at, 1], node[at, 2]
        for c in range(3):
            box[at, c], box[at, 3 + c] = np.inf, -np.inf
            low[c], high[c] = np.inf, -np.inf
        for i in range(start, stop):
            f = order[i]
            for c in range(3):
                low[c] = min(low[c], centre[c, f])
                high[c] = max(high[c], centre[c, f])
                for v in range(3):
                    x = vertices[faces[f, v], c]
                    box[at, c] = min(box[at, c], x)
                    box[at, 3 + c] = max(box[at, 3 + c], x)
        if stop - start <= LEAF:
            node[at, 0] = -1
        else:
            axis = 0
            for c in range(1, 3):
                if high[c] - low[c] > high[axis] - low[axis]:
                    axis = c
            middle = (start + stop) // 2
            _select(order, centre[axis], start, stop, middle)
            node[at, 0] = used
            node[used, 1], node[used, 2] = start, middle
            node[used + 1, 1], node[used + 1, 2] = middle, stop
            used += 2
        at += 1
    return order, box[:used].copy(), node[:used].copy()


@njit(cache=True)
def on_triangle(
    p: NDArray[np.float64],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    triangle: int,
    weight: NDArray[np.float64],
) -> float:
    """Write the barycentric weights of the triangle's point nearest to `p`; return distance².

    After Ericson, Real-Time Collision Detection, section 5.1.5.
    """
    # Number by number: small arrays would take most of the time.
    a, b, c = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    bx, by, bz = vertices[b, 0], vertices[b, 1], vertices[b, 2]
    cx, cy, cz = vertices[c, 0], vertices[c, 1], vertices[c, 2]
    px, py, pz = p[0], p[1], p[2]
    abx, aby, abz = bx - ax, by - ay, bz - az
    acx, acy, acz = cx - ax, cy - ay, cz - az
    apx, apy, apz = px - ax, py - ay, pz - az
    bpx, bpy, bpz = px - bx, py - by, pz - bz
    cpx, cpy, cpz = px - cx, py - cy, pz - cz
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    vc = d1 * d4 - d3 * d2
    vb = d5 * d2 - d1 * d6
    va = d3 * d6 - d5 * d4
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        total = va + vb + vc
        if total <= 0.0:
            return np.inf
        v, w = vb / total, vc / total
    weight[0], weight[1], weight[2] = 1.0 - v - w, v, w
    gx, gy, gz = apx - v * abx - w * acx, apy - v * aby - w * acy, apz - v * abz - w * acz
    return float(gx * gx + gy * gy + gz * gz)


@njit(cache=True)
def _box_gap(p: NDArray[np.float64], box: NDArray[np.float64], at: int) -> float:
    total = 0.0
    for c in range(3):
        gap = max(max(box[at, c] - p[c], p[c] - box[at, 3 + c]), 0.0)
        total += gap * gap
    return total


@njit(cache=True)
def nearest(
    p: NDArray[np.float64],
    hint: int,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    order: NDArray[np.int32],
    box: NDArray[np.float64],
    node: NDArray[np.int32],
    weight: NDArray[np.float64],
) -> int:
    """Return the triangle nearest to `p` and write the barycentric weights of its nearest point.

    `hint` is a triangle tried first (-1: none); it only saves time, except that among equally
    near triangles it is kept.
    """
    trial = np.empty(3)
    best, found = np.inf, -1
    if hint >= 0:
        best = on_triangle(p, vertices, faces, hint, weight)
        found = hint
    stack = np.empty(128, np.int32)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        at = stack[top]
        if _box_gap(p, box, at) >= best:
            continue
        child = node[at, 0]
        if child < 0:
            for i in range(node[at, 1], node[at, 2]):
                f = int(order[i])  # of the type of `hint`, so that one form is compiled
                gap = on_triangle(p, vertices, faces, f, trial)
                if gap < best:
                    best, found = gap, f
                    weight[0], weight[1], weight[2] = trial[0], trial[1], trial[2]
        else:
            nearer = child
            if _box_gap(p, box, child + 1) < _box_gap(p, box, child):
                nearer = child + 1
            stack[top] = 2 * child + 1 - nearer
            stack[top + 1] = nearer
            top += 2
    return found
