"""Whether two triangles cross: corners on both sides of planes first, then edges through faces."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_ROUNDING = 1e-14  # of a distance from a plane, relative, where its triangle is no needle


@njit(cache=True)
def straddling(
    corners: NDArray[np.float64], pairs: NDArray[np.int64], tolerance_mm: float
) -> NDArray[np.bool_]:
    """Whether a triangle has corners on both sides of the other's plane, and the other of its.

    Both are needed for a crossing (Möller, "A fast triangle-triangle intersection test", 1997);
    thin triangles askew to the axes have boxes that overlap by the million without it.
    """
    kept = np.zeros(len(pairs), dtype=np.bool_)
    low, high, slack = np.empty(2), np.empty(2), np.empty(2)
    for k in range(len(pairs)):
        for which in range(2):
            face, other = corners[pairs[k, which]], corners[pairs[k, 1 - which]]
            ux, uy, uz = face[1, 0] - face[0, 0], face[1, 1] - face[0, 1], face[1, 2] - face[0, 2]
            vx, vy, vz = face[2, 0] - face[0, 0], face[2, 1] - face[0, 1], face[2, 2] - face[0, 2]
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            area = np.sqrt(nx * nx + ny * ny + nz * nz)
            low[which], high[which], size = np.inf, -np.inf, 0.0
            for corner in range(3):
                x = other[corner, 0] - face[0, 0]
                y = other[corner, 1] - face[0, 1]
                z = other[corner, 2] - face[0, 2]
                side = (nx * x + ny * y + nz * z) / area if area > 0.0 else 0.0
                low[which], high[which] = min(low[which], side), max(high[which], side)
                size = max(size, abs(x) + abs(y) + abs(z))
            sides = np.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz))
            slack[which] = _ROUNDING * size * (sides / area if area > 0.0 else 0.0)
        if (low > slack).any() or (high < -slack).any():
            continue
        deep = tolerance_mm - slack
        kept[k] = ((low < -deep) & (high > deep)).any()
    return kept


def cross(
    corners: NDArray[np.float64], pairs: NDArray[np.int64], tolerance_mm: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Whether an edge of one triangle runs through the other, and where."""
    hit = np.zeros(len(pairs), dtype=np.bool_)
    point = np.zeros((len(pairs), 3))
    if not len(pairs):
        return hit, point
    # Work about the first corner, so that parts far from the origin lose no digits.
    for one, other in ((0, 1), (1, 0)):
        base = corners[pairs[:, other], 0]
        edge_of = corners[pairs[:, one]] - base[:, None]
        face = corners[pairs[:, other]] - base[:, None]
        normal = np.cross(face[:, 1], face[:, 2])
        area = np.linalg.norm(normal, axis=1)
        fine = area > 0.0
        normal = np.divide(normal, area[:, None], where=fine[:, None], out=np.zeros_like(normal))
        side = np.einsum("kij,kj->ki", edge_of, normal)
        maybe = np.flatnonzero(
            fine & (side.max(axis=1) > tolerance_mm) & (side.min(axis=1) < -tolerance_mm)
        )
        for start in range(3):
            end = (start + 1) % 3
            a, b = side[maybe, start], side[maybe, end]
            chosen = maybe[
                (np.minimum(a, b) < -tolerance_mm) & (np.maximum(a, b) > tolerance_mm)
            ]
            if not len(chosen):
                continue
            share = side[chosen, start] / (side[chosen, start] - side[chosen, end])
            where = edge_of[chosen, start] + share[:, None] * (
                edge_of[chosen, end] - edge_of[chosen, start]
            )
            inside = np.full(len(chosen), np.inf)
            for corner in range(3):
                along = face[chosen, (corner + 1) % 3] - face[chosen, corner]
                length = np.linalg.norm(along, axis=1)
                inward = np.cross(normal[chosen], along) / np.maximum(length, 1e-300)[:, None]
                gap = np.einsum("kj,kj->k", where - face[chosen, corner], inward)
                inside = np.minimum(inside, gap)
            through = inside > tolerance_mm
            hit[chosen[through]] = True
            point[chosen[through]] = where[through] + base[chosen[through]]
    return hit, point
