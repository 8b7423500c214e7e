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
def _dot(a: Floats, b: Floats) -> float:
    """Return the scalar product of two vectors (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@njit(cache=True)
def _copy(vector: Floats, out: Floats) -> None:
    """Copy a vector (3,): a slice's assignment would take a second to compile."""
    for c in range(3):
        out[c] = vector[c]


@njit(cache=True)
def _scale(vector: Floats) -> None:
    """Give a vector (3,) length 1; 0 stays."""
    length = np.sqrt(_dot(vector, vector))
    for c in range(3):
        vector[c] = vector[c] / length if length > 0.0 else vector[c]


@njit(cache=True)
def blend_normals(
    vertices: Floats, faces: Ints, unit: Floats, area: Floats, start: Ints, corner: Ints
) -> Floats:
    """Blend at each corner the normals of the faces around it that make no crease with its own.

    Weighted by area times angle, so that the narrow facets of a fillet don't tilt the wide flat
    face beside it.
    """
    angle = np.zeros((len(faces), 3))
    a, b = np.empty(3), np.empty(3)
    for f in range(len(faces)):
        for v in range(3):
            for c in range(3):
                a[c] = vertices[faces[f, (v + 1) % 3], c] - vertices[faces[f, v], c]
                b[c] = vertices[faces[f, (v + 2) % 3], c] - vertices[faces[f, v], c]
            length = np.sqrt(_dot(a, a) * _dot(b, b))
            if length > 0.0:
                angle[f, v] = np.arccos(min(1.0, max(-1.0, _dot(a, b) / length)))
    limit = np.cos(CREASE_RAD)
    blended = np.zeros((len(faces), 3, 3))
    for f in range(len(faces)):
        for v in range(3):
            vertex, total = faces[f, v], blended[f, v]
            for i in range(start[vertex], start[vertex + 1]):
                g, w = corner[i] // 3, corner[i] % 3
                if _dot(unit[f], unit[g]) >= limit:
                    for c in range(3):
                        total[c] += area[g] * angle[g, w] * unit[g, c]
            if _dot(total, total) > 0.0:
                _scale(total)
            else:
                _copy(unit[f], total)
    return blended


@njit(cache=True)
def _smooth_normal(corner_normals: Floats, f: int, weight: Floats, out: Floats) -> None:
    """Write the unit normal (3,) that the corners' normals (F, 3, 3) blend to at weights (3,)."""
    for c in range(3):
        out[c] = (
            weight[0] * corner_normals[f, 0, c]
            + weight[1] * corner_normals[f, 1, c]
            + weight[2] * corner_normals[f, 2, c]
        )
    _scale(out)  # 0 on a face without area


@njit(cache=True)
def _place(vertices: Floats, faces: Ints, f: int, weight: Floats, out: Floats) -> None:
    """Write the point (3,) of a face at weights (3,)."""
    for c in range(3):
        out[c] = (
            weight[0] * vertices[faces[f, 0], c]
            + weight[1] * vertices[faces[f, 1], c]
            + weight[2] * vertices[faces[f, 2], c]
        )


@njit(cache=True)
def drop(points: Floats, skin: Skin) -> tuple[Floats, Floats, Ints]:
    """Return the nearest points on the mesh (k, 3), their smooth normals and their faces."""
    vertices, faces, corner_normals, order, box, node = skin
    weight = np.empty(3)
    onto = np.empty(points.shape)
    normals = np.empty(points.shape)
    triangles = np.empty(len(points), np.int32)
    f = int(np.int64(-1))  # no literal: one type, compiled once
    for i in range(len(points)):
        f = nearest(points[i], f, vertices, faces, order, box, node, weight)
        triangles[i] = f
        _place(vertices, faces, f, weight, onto[i])
        _smooth_normal(corner_normals, f, weight, normals[i])
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
    weight, limit = np.empty(3), np.cos(CREASE_RAD)
    p, n, t = np.empty(3), np.empty(3), np.empty(3)
    aim, moved, new = np.empty(3), np.empty(3), np.empty(3)
    for k in range(walks):
        _copy(start[k], p)
        _copy(start_normal[k], n)
        _copy(direction[k], t)
        f = int(np.int64(start_triangle[k]))
        for i in range(count):
            if turns[k, i] != 0.0:
                _turn(t, n, turns[k, i])
            parts = max(1, int(np.ceil(steps[k, i] / max_step)))
            h = steps[k, i] / parts
            for _ in range(parts):
                if not complete[k] or h == 0.0:
                    break
                for c in range(3):
                    aim[c] = p[c] + h * t[c]
                f = nearest(aim, f, vertices, faces, order, box, node, weight)
                _place(vertices, faces, f, weight, aim)
                _smooth_normal(corner_normals, f, weight, new)
                for c in range(3):
                    moved[c] = aim[c] - p[c]
                if _dot(moved, moved) < (0.85 * h) * (0.85 * h) or not _dot(new, n) >= limit:
                    complete[k] = False
                    break
                _copy(aim, p)
                _copy(new, n)
                up = _dot(t, n)
                for c in range(3):
                    t[c] -= up * n[c]
                _scale(t)
            _copy(p, points[k, i])
            _copy(n, normals[k, i])
            _copy(t, directions[k, i])
            triangles[k, i] = f
    return points, normals, directions, triangles, complete


@njit(cache=True)
def _turn(way: Floats, about: Floats, angle_rad: float) -> None:
    """Turn a vector (3,) to the left about a unit vector across it."""
    x, y, z = way[0], way[1], way[2]
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    way[0] = cos * x + sin * (about[1] * z - about[2] * y)
    way[1] = cos * y + sin * (about[2] * x - about[0] * z)
    way[2] = cos * z + sin * (about[0] * y - about[1] * x)
