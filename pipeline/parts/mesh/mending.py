"""Mending a triangle mesh: weld, drop, stitch, split, wind alike, fill small holes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]


def _connected(
    one: NDArray[np.int64], other: NDArray[np.int64], count: int
) -> NDArray[np.int32]:
    """Return the number of the connected component of each of `count` nodes, of these links."""
    from scipy.sparse import coo_array  # slow to load, and built-in parts need no mending
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    components: NDArray[np.int32] = connected_components(links, directed=False)[1]
    return components


def halfedges(faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(3F, 2) directed edges, face after face, and the number of the edge each belongs to."""
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    if not len(directed):
        return directed, np.empty(0, dtype=np.int64)
    ends = np.sort(directed, axis=1)
    _, edge = np.unique(ends[:, 0] * (int(ends.max()) + 1) + ends[:, 1], return_inverse=True)
    return directed, edge.reshape(-1)


def used(vertices: Vertices, faces: Faces) -> tuple[Vertices, Faces]:
    """Drop vertices that no face names; the others keep their order."""
    named = np.bincount(faces.reshape(-1), minlength=len(vertices)) > 0
    return vertices[named], (np.cumsum(named) - 1)[faces]


def weld(vertices: Vertices, faces: Faces) -> tuple[Vertices, Faces]:
    """Join vertices of equal coordinates and drop unused ones; order by first use in faces."""
    points, corner = used(vertices + 0.0, faces)
    kept, inverse = np.unique(points, axis=0, return_inverse=True)
    welded = inverse.reshape(-1)[corner.reshape(-1)]
    _, first, number = np.unique(welded, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first, kind="stable"), kind="stable")
    order = welded[np.sort(first)]
    return kept[order], rank[number.reshape(-1)].reshape(-1, 3)


def weld_close(
    vertices: Vertices, faces: Faces, tolerance_mm: float
) -> tuple[Vertices, Faces, int]:
    """Join vertices of open edges that are closer than the tolerance; says how many went."""
    directed, edge = halfedges(faces)
    rim = np.unique(directed[np.bincount(edge)[edge] == 1])
    pairs = cKDTree(vertices[rim]).query_pairs(tolerance_mm, output_type="ndarray")
    if not len(pairs):
        return vertices, faces, 0
    group = _connected(pairs[:, 0], pairs[:, 1], len(rim))
    _, first = np.unique(group, return_index=True)
    target = np.arange(len(vertices))
    target[rim] = rim[first[group]]
    joined = int((target != np.arange(len(vertices))).sum())
    vertices, faces = weld(vertices, target[faces])
    return vertices, faces, joined


def drop_collapsed(faces: Faces) -> tuple[Faces, int]:
    """Drop faces that name a vertex twice."""
    a, b, c = faces.T
    keep = (a != b) & (b != c) & (c != a)
    return faces[keep], int((~keep).sum())


def drop_doubled(faces: Faces) -> tuple[Faces, int]:
    """Keep one of the faces that stand twice, none of pairs that stand back to back."""
    ends = np.sort(faces, axis=1)
    _, group = np.unique(ends, axis=0, return_inverse=True)
    group = group.reshape(-1)
    # Even permutation of the sorted corners or odd: which way round the face is wound.
    rising = (np.diff(faces, axis=1) > 0).sum(axis=1) + (faces[:, 2] > faces[:, 0])
    way = np.where(rising % 2 == 1, 1, -1)
    net = np.bincount(group, weights=way)
    keep = np.zeros(len(faces), dtype=np.bool_)
    for sign in (1, -1):
        rows = np.flatnonzero(way == sign)
        _, first = np.unique(group[rows], return_index=True)
        chosen = rows[first]
        keep[chosen[net[group[chosen]] * sign > 0]] = True
    return faces[keep], int((~keep).sum())


def flip_needles(vertices: Vertices, faces: Faces, tolerance_mm: float) -> tuple[Faces, int]:
    """Turn the long edge of faces without height, so that none is left without a normal.

    A needle a, b, c with b on the edge from a to c stands for a T-junction: it and its neighbour
    across that edge become the two halves of the neighbour, split at b.
    """
    faces = faces.copy()
    turned = 0
    for _ in range(20):
        corners = vertices[faces]
        length = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2)
        area = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        needles = np.flatnonzero(area <= tolerance_mm * length.max(axis=1))
        if not len(needles):
            break
        directed, edge = halfedges(faces)
        order = np.argsort(edge, kind="stable")
        start = np.searchsorted(edge[order], np.arange(edge.max() + 2))
        near = np.isin(directed, faces[needles]).any(axis=1)
        present = set(map(tuple, np.sort(directed[near], axis=1).tolist()))
        touched: set[int] = set()
        done = 0
        for needle in needles.tolist():
            long = int(np.argmax(length[needle]))
            own = 3 * needle + long
            group = order[start[edge[own]] : start[edge[own] + 1]]
            if len(group) != 2:
                continue
            twin = int(group[0] if group[1] == own else group[1])
            other = twin // 3
            if needle in touched or other in touched or other == needle:
                continue
            a, c = directed[own].tolist()
            b = int(faces[needle, (long + 2) % 3])
            d = int(faces[other, (twin % 3 + 2) % 3])
            if b == d or directed[twin].tolist() != [c, a]:
                continue
            if (min(b, d), max(b, d)) in present:
                continue
            present.add((min(b, d), max(b, d)))
            faces[needle], faces[other] = (a, d, b), (d, c, b)
            touched |= {needle, other}
            done += 1
        turned += done
        if not done:
            break
    return faces, turned


def part_edges(vertices: Vertices, faces: Faces) -> tuple[Vertices, Faces, int, int]:
    """Take apart what meets in an edge of four faces or more, or in a vertex only.

    Around such an edge the two faces of one body stay together. The rest is sorted by angle
    and paired so that each pair has solid between it: a face that runs against the edge and the
    next one that runs along it. Each surface then gets vertices of its own.

    Returns
    -------
    tuple
        Vertices, faces, the number of edges taken apart, and of those that can't be since not
        as many faces run along them as against.
    """
    directed, edge = halfedges(faces)
    count = np.bincount(edge)
    balance = np.bincount(edge, weights=np.where(directed[:, 0] < directed[:, 1], 1, -1))
    order = np.argsort(edge, kind="stable")
    start = np.searchsorted(edge[order], np.arange(len(count)))
    pairs = [order[count[edge[order]] == 2].reshape(-1, 2)]
    busy = np.flatnonzero((count > 2) & (balance == 0))
    body = bodies(faces) if len(busy) else np.empty(0, dtype=np.int64)
    for number in busy.tolist():
        group = order[start[number] : start[number] + count[number]]
        members, times = np.unique(body[group // 3], return_counts=True)
        for member in members[times == 2].tolist():
            two = group[body[group // 3] == member]
            if directed[two[0], 0] != directed[two[1], 0]:
                pairs.append(two[None])
                group = group[body[group // 3] != member]
        if len(group):
            pairs.append(_around(vertices, faces, directed, group))
    left = int(((count > 2) & (balance != 0)).sum())
    pair = np.concatenate(pairs)
    # Corners of neighbours at the same vertex belong together.
    face, corner = pair // 3, pair % 3
    ends = np.stack([3 * face + corner, 3 * face + (corner + 1) % 3], axis=-1)
    against = directed[pair[:, 0], 0] != directed[pair[:, 1], 0]
    other = np.where(against[:, None], ends[:, 1, ::-1], ends[:, 1])
    rows, columns = ends[:, 0].ravel(), other.ravel()
    own = _connected(rows, columns, faces.size)
    _, first, names = np.unique(own, return_index=True, return_inverse=True)
    return vertices[faces.ravel()[first]], names.reshape(-1, 3), len(busy), left


def _around(
    vertices: Vertices, faces: Faces, directed: NDArray[np.int64], group: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Pair the halfedges of one edge, each against with the next along in the order of angles."""
    a, b = np.sort(directed[group[0]])
    axis = vertices[b] - vertices[a]
    axis = axis / np.linalg.norm(axis)
    apex = vertices[faces[group // 3, (group % 3 + 2) % 3]] - vertices[a]
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angle = np.arctan2(apex @ np.cross(axis, first), apex @ first)
    along = directed[group, 0] == a
    # Faces in contact have one angle: what ends there comes before what begins there.
    order = np.lexsort((~along, np.round(angle, 7)))
    depth = np.cumsum(np.where(along[order], -1, 1))
    order = np.roll(order, -(int(np.argmin(depth)) + 1))
    waiting: list[int] = []
    pairs = []
    for k in order.tolist():
        if along[k]:
            pairs.append((group[waiting.pop(0)], group[k]))
        else:
            waiting.append(k)
    return np.array(pairs, dtype=np.int64)


def bodies(faces: Faces) -> NDArray[np.int64]:
    """(F,) number of the body of each face: faces joined across edges of exactly two faces."""
    _, edge = halfedges(faces)
    order = np.argsort(edge, kind="stable")
    pair = order[np.bincount(edge)[edge[order]] == 2].reshape(-1, 2) // 3
    body = _connected(pair[:, 0], pair[:, 1], len(faces))
    return np.asarray(body, dtype=np.int64)


def wind_alike(faces: Faces) -> tuple[Faces, int, int]:
    """Turn faces so that neighbours are wound alike; the fewest faces of each body are turned.

    Returns
    -------
    tuple
        The faces, how many were turned, and the number of bodies that have no outside
        (one-sided like a Moebius strip).
    """
    directed, edge = halfedges(faces)
    order = np.argsort(edge, kind="stable")
    pair = order[np.bincount(edge)[edge[order]] == 2].reshape(-1, 2)
    against = directed[pair[:, 0], 0] == directed[pair[:, 1], 0]
    f, g = pair[:, 0] // 3, pair[:, 1] // 3
    n = len(faces)
    # Two nodes a face, as it stands and turned; links join the states that agree.
    rows = np.concatenate([f, f + n])
    columns = np.concatenate([np.where(against, g + n, g), np.where(against, g, g + n)])
    state = _connected(rows, columns, 2 * n)
    one_sided = state[:n] == state[n:]
    body = bodies(faces)
    low = np.minimum(state[:n], state[n:])
    turn = state[:n] != low
    turned = np.bincount(body, weights=turn)
    whole = np.bincount(body)
    turn = np.where((turned > whole / 2.0)[body], ~turn, turn) & ~one_sided
    result = faces.copy()
    result[turn] = result[turn][:, ::-1]
    return result, int(turn.sum()), len(np.unique(body[one_sided]))


def open_loops(faces: Faces) -> list[NDArray[np.int64]]:
    """Chain the open edges into loops, each as vertex numbers in the order of a filling's winding.

    Loops that touch in a vertex are taken apart where they do.
    """
    directed, edge = halfedges(faces)
    rim = directed[np.bincount(edge)[edge] == 1] if len(edge) else directed
    following: dict[int, list[int]] = {}
    for a, b in rim.tolist():
        following.setdefault(b, []).append(a)
    loops = []
    for first in sorted(following):
        while following.get(first):
            chain, place = [first], {first: 0}
            while following.get(chain[-1]):
                vertex = following[chain[-1]].pop()
                if vertex in place:
                    cut = place[vertex]
                    loops.append(np.array(chain[cut:], dtype=np.int64))
                    for gone in chain[cut + 1 :]:
                        del place[gone]
                    chain = chain[: cut + 1]
                else:
                    place[vertex] = len(chain)
                    chain.append(vertex)
    return [loop for loop in loops if len(loop) >= 3]


def fill_loop(points_mm: Vertices) -> NDArray[np.int64]:
    """(n - 2, 3) triangles over a loop of n points: those of least area in all.

    The classic dynamic programme over the loop (Barequet and Sharir, "Filling gaps in the
    boundary of a polyhedron", 1995).
    """
    n = len(points_mm)
    cost = np.zeros((n, n))
    apex = np.zeros((n, n), dtype=np.int64)
    for width in range(2, n):
        for i in range(n - width):
            k = i + width
            m = np.arange(i + 1, k)
            crossed = np.cross(points_mm[m] - points_mm[i], points_mm[k] - points_mm[i])
            total = cost[i, m] + cost[m, k] + np.linalg.norm(crossed, axis=1)
            best = int(np.argmin(total))
            cost[i, k], apex[i, k] = total[best], m[best]
    triangles: list[tuple[int, int, int]] = []
    stack = [(0, n - 1)]
    while stack:
        low, high = stack.pop()
        if high - low < 2:
            continue
        middle = int(apex[low, high])
        triangles.append((low, middle, high))
        stack += [(low, middle), (middle, high)]
    return np.array(triangles, dtype=np.int64)
