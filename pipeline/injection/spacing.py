"""Spacing of flaws: sample points of a cutter that represent its faces."""

from functools import cached_property
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from defects.carving.solid import Cutter

Floats = NDArray[np.float64]

SHARE: Final = 0.6  # of the points' distance: no place of a triangle is further from its corners
FINEST: Final = 50  # points across a cutter, at most


class Footprint:
    """Sample points of a cutter, for distances to others; drawn where something is near.

    Distances are accurate to `wanted_mm`, up to a limit.

    Parameters
    ----------
    cutter
        The cutter.
    wanted_mm
        Least distance to others.
    """

    def __init__(self, cutter: Cutter, wanted_mm: float) -> None:
        self._solids = cutter.solids
        self._box_mm = cutter.box_mm
        size = float(np.ptp(self._box_mm, axis=0).max())
        self._edge_mm = max(wanted_mm / SHARE, size / FINEST)
        self._wanted_mm = wanted_mm

    @property
    def spacing_mm(self) -> float:
        """Return how far a place of the cutter's faces may be from the nearest point."""
        return SHARE * self._edge_mm

    @cached_property
    def points_mm(self) -> Floats:
        """Return points (n, 3) on the cutter's faces."""
        return np.concatenate(
            [_sampled(solid.vertices_mm[solid.faces], self._edge_mm) for solid in self._solids]
            + [solid.vertices_mm for solid in self._solids]
        )

    @cached_property
    def _tree(self) -> cKDTree:
        # unbalanced: built in a third of the time, and asked once or twice
        return cKDTree(self.points_mm, balanced_tree=False, compact_nodes=False)

    def is_near(self, other: Self) -> bool:
        """Return whether another cutter may be nearer than wanted."""
        gap = max(self._wanted_mm, self.spacing_mm, other.spacing_mm)
        low, high = other._box_mm
        if _apart(self._box_mm, other._box_mm, gap):
            return False
        points = self.points_mm
        points = points[((points >= low - gap) & (points <= high + gap)).all(axis=1)]
        return bool(np.isfinite(other._tree.query(points, distance_upper_bound=gap)[0]).any())

    def is_near_point(self, place_mm: Floats) -> bool:
        """Return whether a place (3,) may be nearer than wanted."""
        gap = max(self._wanted_mm, self.spacing_mm)
        if _apart(self._box_mm, np.stack([place_mm, place_mm]), gap):
            return False
        return bool(self._tree.query(place_mm)[0] < gap)


def _apart(one_mm: Floats, other_mm: Floats, gap_mm: float) -> bool:
    """Return whether two boxes (2, 3) are further apart than a gap along an axis."""
    return bool((np.maximum(one_mm[0] - other_mm[1], other_mm[0] - one_mm[1]) > gap_mm).any())


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
