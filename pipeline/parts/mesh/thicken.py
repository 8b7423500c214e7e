"""Growing an open sheet skin into a thin closed solid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.mesh.mending import halfedges

_SHARPEST = 0.2


def thicken(
    vertices_mm: NDArray[np.float64], faces: NDArray[np.int64], thickness_mm: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Offset a skin along its vertex normals and close it along its boundary.

    The skin itself stays where it is; its copy lies `thickness_mm` behind it (against the
    normals; in front where negative). Each vertex moves so that the planes of its faces move by
    the thickness as nearly as they can: the offset o solves sum_f w_f n_f n_f' o = sum_f w_f n_f
    (w_f the face's angle at the vertex), which is exact on planes, edges and corners of three
    planes; the least-norm solution is taken.

    Parameters
    ----------
    vertices_mm, faces
        A skin whose faces are wound alike, (V, 3) and (F, 3); every edge has one or two faces.
    thickness_mm
        Thickness, mm, not zero.

    Returns
    -------
    tuple
        Vertices (2V, 3) and faces of the solid, wound outward.
    """
    offset = vertex_offsets(vertices_mm, faces)
    count = len(vertices_mm)
    back = vertices_mm - thickness_mm * offset
    directed, edge = halfedges(faces)
    a, b = directed[np.bincount(edge)[edge] == 1].T
    wall = np.concatenate(
        [np.stack([b, a, a + count], axis=1), np.stack([b, a + count, b + count], axis=1)]
    )
    solid = np.concatenate([faces, faces[:, ::-1] + count, wall])
    if thickness_mm < 0.0:
        solid = solid[:, ::-1]
    return np.concatenate([vertices_mm, back]), solid


def vertex_offsets(
    vertices_mm: NDArray[np.float64], faces: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(V, 3) offset of each vertex that lifts the planes of its faces by one."""
    corners = vertices_mm[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, where=length > 0.0, out=np.zeros_like(normal))
    matrix = np.zeros((len(vertices_mm), 3, 3))
    side = np.zeros((len(vertices_mm), 3))
    for corner in range(3):
        one = corners[:, (corner + 1) % 3] - corners[:, corner]
        two = corners[:, (corner + 2) % 3] - corners[:, corner]
        angle = np.arctan2(
            np.linalg.norm(np.cross(one, two), axis=1), np.einsum("ij,ij->i", one, two)
        )
        np.add.at(
            matrix,
            faces[:, corner],
            angle[:, None, None] * normal[:, :, None] * normal[:, None, :],
        )
        np.add.at(side, faces[:, corner], angle[:, None] * normal)
    # Directions in which the faces hardly differ get no say (_SHARPEST of the strongest), so
    # that noise on nearly flat skins doesn't shift vertices sideways.
    value, vector = np.linalg.eigh(matrix)
    strong = value > (_SHARPEST**2) * value[:, -1:]
    inverse = np.where(strong, 1.0 / np.where(strong, value, 1.0), 0.0)
    in_axes = np.einsum("vij,vi->vj", vector, side)
    return np.asarray(np.einsum("vij,vj->vi", vector, inverse * in_axes))
