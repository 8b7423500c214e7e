"""Built-in parts, each built once, and points spread over their faces."""

import numpy as np

from pipeline.parts.builtin import build
from pipeline.parts.part import Part

_BUILT: dict[tuple[str, float | None], Part] = {}


def built(name: str, facet_um: float | None = None) -> Part:
    """Each part once for all tests."""
    if (name, facet_um) not in _BUILT:
        _BUILT[name, facet_um] = build(name, facet_um)
    return _BUILT[name, facet_um]


def spread(part: Part, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points spread over faces (k, 7, 3) and the faces' unit normals (k, 1, 3)."""
    weights = np.array(
        [(1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (4, 1, 1), (1, 4, 1), (1, 1, 4)], dtype=float
    )
    weights /= weights.sum(axis=1, keepdims=True)
    corners = part.vertices_mm[part.faces[faces]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.einsum("pc,kcd->kpd", weights, corners), normal[:, None]
