"""Spacing of flaws: sample points of a cutter that represent its faces."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from defects.carving.solid import Cutter

Floats = NDArray[np.float64]

SHARE: Final = 0.6  # of the points' distance: no place of a triangle is further from its corners
FINEST: Final = 50  # points across a cutter, at most


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Footprint:
    """Sample points of a cutter, for distances to others.

    Parameters
    ----------
    points_mm
        (n, 3) on its faces.
    spacing_mm
        How far a place of its faces may be from the nearest of them.
    tree
        Of the points.
    """

    points_mm: Floats
    spacing_mm: float
    tree: cKDTree

    @classmethod
    def of(cls, cutter: Cutter, wanted_mm: float) -> Self:
        """Sample a cutter so that distances are accurate to `wanted_mm`, up to a limit."""
        size = float(np.ptp(cutter.box_mm, axis=0).max())
        edge_mm = max(wanted_mm / SHARE, size / FINEST)
        points = np.concatenate(
            [_sampled(solid.vertices_mm[solid.faces], edge_mm) for solid in cutter.solids]
            + [solid.vertices_mm for solid in cutter.solids]
        )
        return cls(points_mm=points, spacing_mm=SHARE * edge_mm, tree=cKDTree(points))

    def is_near(self, other: Self, wanted_mm: float) -> bool:
        """Return whether another cutter may be nearer than wanted."""
        gap = max(wanted_mm, self.spacing_mm, other.spacing_mm)
        return bool(
            np.isfinite(other.tree.query(self.points_mm, distance_upper_bound=gap)[0]).any()
        )


def _sampled(corners_mm: Floats, edge_mm: float) -> Floats:
    """Return points on triangles (k, 3, 3) whose edges are longer than `edge_mm`, no further apart.

    A triangle is divided into n² of its own shape.
    """
    edges = np.linalg.norm(corners_mm - np.roll(corners_mm, 1, axis=1), axis=2)
    parts = np.ceil(edges.max(axis=1, initial=0.0) / edge_mm).astype(np.int64)
    found = [np.zeros((0, 3))]
    for n in np.unique(parts[parts > 1]):
        i, j = (index.ravel() for index in np.mgrid[0 : n + 1, 0 : n + 1])
        i, j = i[i + j <= n], j[i + j <= n]
        weight = np.stack([n - i - j, i, j], axis=1) / n
        found.append((weight @ corners_mm[parts == n]).reshape(-1, 3))
    return np.concatenate(found)
