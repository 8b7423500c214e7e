"""The wall under a flaw: its thickness, and whether the flaw breaks through."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]


def on_far_side(skin_mm: Floats, normals: Floats, centres: Floats, cross: Floats) -> bool:
    """Return whether lost skin lies on the far side: facets turned away from the flaw's skin.

    Parameters
    ----------
    skin_mm, normals
        (n, 3) the skin over the flaw and its normals.
    centres, cross
        (m, 3) lost facets: their centres, and vectors along their normals, twice their areas long.
    """
    if not len(cross):
        return False
    nearest = cKDTree(skin_mm).query(centres)[1]
    size = np.linalg.norm(cross, axis=1)
    away = np.einsum("ij,ij->i", cross, normals[nearest]) < -0.5 * size
    return bool(size[away].sum() > 1e-6 * size.sum())


def thickness_mm(
    vertices_mm: Floats, faces: NDArray[np.int32], point: Floats, normal: Floats
) -> float:
    """Return how far a line from the skin runs along `-normal` until it leaves the solid."""
    a, b, c = (vertices_mm[faces[:, i]] for i in range(3))
    along = -normal
    e1, e2 = b - a, c - a
    h = np.cross(along, e2)
    det = np.einsum("ij,ij->i", e1, h)
    det = np.where(np.abs(det) < 1e-300, np.inf, det)
    s = point - a
    u = np.einsum("ij,ij->i", s, h) / det
    q = np.cross(s, e1)
    v = q @ along / det
    t = np.einsum("ij,ij->i", e2, q) / det
    # Where the line leaves, it goes along with the facet's normal.
    leaves = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6) & (np.cross(e1, e2) @ along > 0)
    return float(t[leaves].min()) if leaves.any() else np.inf
