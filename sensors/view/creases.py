"""Concave creases of a part, and what a fillet in them would change."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from sensors.casting.scene import Scene
from sensors.view.view import View

Floats = NDArray[np.float64]

LEAST_TURN, MOST_TURN = np.radians([15.0, 150.0])
"""Turn of the surface at a crease; facets of a curved face turn less, slits more."""
SAMPLES = 4
"""Points along a crease for each reach of the fillet in it."""
BESIDE_MM = 0.02
"""How far a point that names a crease may lie off its line."""
OWN_FACE = 0.02
"""How far a point may lie off a crease's face, over its distance from the crease."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Creases:
    """Edges at which two faces meet in a concave corner, part frame.

    Attributes
    ----------
    start_mm, end_mm : (k, 3)
    normals : (k, 2, 3) of the two faces, outwards
    turn_rad : (k,) angle between them
    """

    start_mm: Floats
    end_mm: Floats
    normals: Floats
    turn_rad: Floats

    @property
    def length_mm(self) -> Floats:
        """Length of each, (k,)."""
        return np.asarray(np.linalg.norm(self.end_mm - self.start_mm, axis=1))

    @property
    def along(self) -> Floats:
        """Unit direction of each, (k, 3)."""
        return np.asarray((self.end_mm - self.start_mm) / self.length_mm[:, None])

    @property
    def middle_mm(self) -> Floats:
        """Middle of each, (k, 3): a point that names it."""
        return 0.5 * (self.start_mm + self.end_mm)


@lru_cache(maxsize=4)
def concave_creases(scene: Scene) -> Creases:
    """Find the concave creases of a part."""
    import trimesh  # half a second that few scans need

    mesh = trimesh.Trimesh(scene.vertices_mm, scene.faces, process=False)
    turn = mesh.face_adjacency_angles
    sharp = ~mesh.face_adjacency_convex & (turn > LEAST_TURN) & (turn < MOST_TURN)
    ends = scene.vertices_mm[mesh.face_adjacency_edges]
    sharp &= np.any(ends[:, 0] != ends[:, 1], axis=1)
    ends = ends[sharp]
    return Creases(
        start_mm=ends[:, 0],
        end_mm=ends[:, 1],
        normals=scene.normals[mesh.face_adjacency[sharp]],
        turn_rad=turn[sharp],
    )


def filled_mm(
    view: View, radius_mm: float, corners_mm: ArrayLike = ()
) -> tuple[Floats, NDArray[np.int64]]:
    """Return by how much fillets in concave corners shorten the laser's path.

    The fillet touches both faces at t = r tan(τ/2) from the crease, τ the angle between their
    normals. In the plane across the crease the ray meets its arc of radius r about C before the
    face, by the first root of |P - λ u - C|² = r². A fillet ends where its crease does.

    Parameters
    ----------
    corners_mm : (3 k,) points on the creases that hold one, part frame; all do where empty

    Returns
    -------
    filled : (n, m) mm, NaN at missing readings
    crease : (n, m) number of the crease whose fillet is met, -1 elsewhere
    """
    creases = concave_creases(view.scene)
    filled = np.where(view.in_range, 0.0, np.nan)
    crease = np.full(view.shape, -1)
    if radius_mm <= 0 or len(creases.turn_rad) == 0:
        return filled, crease
    reach = radius_mm * np.tan(creases.turn_rad / 2)
    near = _nearest(creases, reach, view.part_mm[view.in_range])
    pick = np.flatnonzero(near >= 0)
    index = np.flatnonzero(view.in_range)[pick]
    own = near[pick]
    point = view.part_mm.reshape(-1, 3)[index]
    normal = view.scene.normals[view.triangle.ravel()[index]]
    row, column = np.unravel_index(index, view.shape)
    # as long as the depth rises by a millimetre
    ray = np.einsum("kij,kj->ki", view.poses[row, :3, :3], (view.ray / view.ray[:, 2:])[column])
    along = creases.along[own]
    way = point - creases.start_mm[own]
    place = np.sum(way * along, axis=1)
    way -= place[:, None] * along
    # creases in one line are told apart to a quarter of their samples' step
    past = np.abs(place - 0.5 * creases.length_mm[own]) - 0.5 * creases.length_mm[own]
    distance = np.linalg.norm(way, axis=1)
    on_face = (
        (np.einsum("kij,kj->ki", creases.normals[own], normal).max(axis=1) > 1 - OWN_FACE)
        & (np.abs(np.sum(way * normal, axis=1)) <= OWN_FACE * distance + 1e-6)
        & (distance < reach[own])
        & (past <= 0.25 * reach.max() / SAMPLES)
    )
    outwards = way / np.maximum(distance, 1e-12)[:, None]
    across, down = np.sum(ray * outwards, axis=1), np.sum(ray * normal, axis=1)
    left = distance - reach[own]
    ahead = left * across - radius_mm * down
    square = across**2 + down**2
    root = ahead**2 - square * left**2
    hit = on_face & (ahead > 0) & (root >= 0)
    hit &= _through(creases, np.asarray(corners_mm, dtype=np.float64).reshape(-1, 3))[own]
    rise = np.where(hit, (ahead - np.sqrt(np.maximum(root, 0.0))) / square, 0.0)
    filled.ravel()[index] = rise
    crease.ravel()[index[hit]] = own[hit]
    return filled, crease


def _through(creases: Creases, points_mm: Floats) -> NDArray[np.bool_]:
    """Return which creases run through one of the points (k, 3); all without points.

    What was cut off a crease's end still belongs to it, up to the length that is left.
    """
    if len(points_mm) == 0:
        return np.ones(len(creases.turn_rad), dtype=bool)
    along, length = creases.along, creases.length_mm
    found = np.zeros(len(length), dtype=bool)
    for point in points_mm:
        way = point - creases.start_mm
        place = np.sum(way * along, axis=1)
        beside = np.linalg.norm(way - place[:, None] * along, axis=1)
        found |= (beside < BESIDE_MM) & (place > -length) & (place < 2 * length)
    return found


def _nearest(creases: Creases, reach: Floats, points_mm: Floats) -> NDArray[np.int64]:
    """Return the number of the crease nearest to each point; -1 beyond its fillet's reach."""
    farthest = float(reach.max())
    counts = np.ceil(SAMPLES * creases.length_mm / farthest).astype(np.int64)
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    # none at an end, which the next crease may share
    share = (((np.arange(len(owner)) - first[owner]) + 0.5) / counts[owner])[:, None]
    samples = (1 - share) * creases.start_mm[owner] + share * creases.end_mm[owner]
    # half a step aside from the nearest sample at most
    bound = farthest * np.hypot(1.0, 0.5 / SAMPLES)
    away, which = cKDTree(samples).query(points_mm, distance_upper_bound=bound)
    return np.where(np.isfinite(away), owner[np.minimum(which, len(owner) - 1)], -1)
