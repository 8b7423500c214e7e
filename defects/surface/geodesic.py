"""Walks on a triangle mesh with blended normals: the compiled part of `surface.py`."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from defects.surface.nearest_point import nearest

CREASE_RAD = np.deg2rad(32.0)
"""Faces that meet at a greater angle are an edge of the part: normals aren't blended over it.

A blended normal stands off its facet's by half of that at most, so a depth along it is 4 % less
when measured from the facet.
"""

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Skin(NamedTuple):
    """A mesh as compiled functions take it: blended normals of its corners, its tree of boxes.

    `order`, `box` and `node` are those of `defects.surface.nearest_point.build_tree`.
    """

    vertices: Floats
    faces: Ints
    corner_normals: Floats
    order: Ints
    box: Floats
    node: Ints


@njit(cache=True)
def blend_normals(
    vertices: Floats, faces: Ints, unit: Floats, area: Floats, start: Ints, corner: Ints
) -> Floats:
    """Blend at each corner the normals of the faces around it that make no crease with its own.

    Weighted by area times angle, so that the narrow facets of a fillet don't tilt the wide flat
    face beside it.
    """
    angle = np.zeros((len(faces), 3))
    for f in range(len(faces)):
        for v in range(3):
            a = vertices[faces[f, (v + 1) % 3]] - vertices[faces[f, v]]
            b = vertices[faces[f, (v + 2) % 3]] - vertices[faces[f, v]]
            length = np.sqrt(np.dot(a, a) * np.dot(b, b))
            if length > 0.0:
                angle[f, v] = np.arccos(min(1.0, max(-1.0, np.dot(a, b) / length)))
    limit = np.cos(CREASE_RAD)
    blended = np.empty((len(faces), 3, 3))
    for f in range(len(faces)):
        for v in range(3):
            total = np.zeros(3)
            vertex = faces[f, v]
            for i in range(start[vertex], start[vertex + 1]):
                g, w = corner[i] // 3, corner[i] % 3
                if np.dot(unit[f], unit[g]) >= limit:
                    total += area[g] * angle[g, w] * unit[g]
            length = np.sqrt(np.dot(total, total))
            blended[f, v] = total / length if length > 0.0 else unit[f]
    return blended


@njit(cache=True)
def smooth_normal(corner_normals: Floats, triangle: int, weight: Floats) -> Floats:
    """Return the unit normal (3,) that the corners' normals (F, 3, 3) blend to at weights (3,)."""
    n = (
        weight[0] * corner_normals[triangle, 0]
        + weight[1] * corner_normals[triangle, 1]
        + weight[2] * corner_normals[triangle, 2]
    )
    length = np.sqrt(np.dot(n, n))
    return np.asarray(n / length if length > 0.0 else n)  # 0 on a face without area


@njit(cache=True)
def drop(points: Floats, skin: Skin) -> tuple[Floats, Floats, Ints]:
    """Return the nearest points on the mesh (k, 3), their smooth normals and their faces."""
    vertices, faces, corner_normals, order, box, node = skin
    weight = np.empty(3)
    onto = np.empty(points.shape)
    normals = np.empty(points.shape)
    triangles = np.empty(len(points), np.int32)
    f = -1
    for i in range(len(points)):
        f = nearest(points[i], f, vertices, faces, order, box, node, weight)
        triangles[i] = f
        for c in range(3):
            onto[i, c] = (
                weight[0] * vertices[faces[f, 0], c]
                + weight[1] * vertices[faces[f, 1], c]
                + weight[2] * vertices[faces[f, 2], c]
            )
        normals[i] = smooth_normal(corner_normals, f, weight)
    return onto, normals, triangles


@njit(cache=True)
def walk(
    start: Floats,
    start_normal: Floats,
    start_triangle: Ints,
    direction: Floats,
    steps: Floats,
    turns: Floats,
    max_step: float,
    skin: Skin,
) -> tuple[Floats, Floats, Floats, Ints, NDArray[np.bool_]]:
    """March: step along the tangent, drop onto the mesh, carry the direction along."""
    vertices, faces, corner_normals, order, box, node = skin
    walks, count = steps.shape
    points = np.empty((walks, count, 3))
    normals = np.empty((walks, count, 3))
    directions = np.empty((walks, count, 3))
    triangles = np.empty((walks, count), np.int32)
    complete = np.ones(walks, np.bool_)
    weight = np.empty(3)
    limit = np.cos(CREASE_RAD)
    for k in range(walks):
        p, n, t = start[k].copy(), start_normal[k].copy(), direction[k].copy()
        f = start_triangle[k]
        for i in range(count):
            turn = turns[k, i]
            if turn != 0.0:
                t = np.cos(turn) * t + np.sin(turn) * np.cross(n, t)
            parts = max(1, int(np.ceil(steps[k, i] / max_step)))
            h = steps[k, i] / parts
            for _ in range(parts):
                if not complete[k] or h == 0.0:
                    break
                aim = p + h * t
                f = nearest(aim, f, vertices, faces, order, box, node, weight)
                reached = (
                    weight[0] * vertices[faces[f, 0]]
                    + weight[1] * vertices[faces[f, 1]]
                    + weight[2] * vertices[faces[f, 2]]
                )
                new = smooth_normal(corner_normals, f, weight)
                moved = reached - p
                if np.dot(moved, moved) < (0.85 * h) ** 2 or not np.dot(new, n) >= limit:
                    complete[k] = False
                    break
                p, n = reached, new
                t = t - np.dot(t, n) * n
                t = t / np.sqrt(np.dot(t, t))
            points[k, i], normals[k, i], directions[k, i] = p, n, t
            triangles[k, i] = f
    return points, normals, directions, triangles, complete
