"""Closed solids and what is carved out of them and put onto them: the one user of manifold3d."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from defects.point_in_mesh import Inside

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class BooleanError(RuntimeError):
    """A boolean operation failed one of its checks; one line says which."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Solid:
    """A closed triangle mesh, wound outwards.

    Parameters
    ----------
    vertices_mm
        (V, 3) float64, part frame.
    faces
        (F, 3) int32.
    """

    vertices_mm: Floats
    faces: Ints

    @property
    def volume_mm3(self) -> float:
        """Return the signed volume, by the divergence theorem about the first vertex."""
        a, b, c = (self.vertices_mm[self.faces[:, i]] - self.vertices_mm[0] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    @property
    def closed(self) -> bool:
        """Return whether each edge has as many faces one way as the other way."""
        return is_closed(self.faces)

    @classmethod
    def union(cls, solids: tuple[Self, ...]) -> Self:
        """Return the union of solids that may overlap.

        Raises
        ------
        BooleanError
            When one isn't a closed solid.
        """
        if len(solids) == 1:
            return solids[0]
        return cls._of(_add([_manifold(solid, Manifold.reserve_ids(1)) for solid in solids]))

    @classmethod
    def _of(cls, manifold: Manifold) -> Self:
        mesh = manifold.to_mesh64()
        return cls(
            vertices_mm=np.array(mesh.vert_properties, np.float64)[:, :3],
            faces=np.array(mesh.tri_verts, np.int32),
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Cutter:
    """The solids by which a flaw changes a part: first `removed` goes, then `added` comes.

    Parameters
    ----------
    removed, added
        Closed solids, or None. Where they overlap, material is there afterwards.
    skin_mm, normals
        (n, 3) places of the part's skin under the flaw's wanted surface and the local normals.
    height_mm
        (n,) the wanted surface above the skin along the normal; below zero under it.
    above_mm
        (m, 3) points of the solids that must lie in the air.
    """

    removed: Solid | None
    added: Solid | None
    skin_mm: Floats
    normals: Floats
    height_mm: Floats
    above_mm: Floats

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Return the solids that there are."""
        return tuple(solid for solid in (self.removed, self.added) if solid is not None)

    @property
    def box_mm(self) -> Floats:
        """Return the least and the greatest corner (2, 3) of all the solids."""
        points = np.concatenate([solid.vertices_mm for solid in self.solids])
        return np.stack([points.min(axis=0), points.max(axis=0)])


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """What one flaw does to the part.

    Parameters
    ----------
    removed_mm3, added_mm3
        Volumes of part that goes and of material that comes, exact for the meshes.
    opening_mm2
        Area of the part's skin that is no longer surface.
    depth_mm
        Greatest depth under the skin along the local normal; the height, if nothing is removed.
    through
        Whether it pierces the part.
    """

    removed_mm3: float
    added_mm3: float
    opening_mm2: float
    depth_mm: float
    through: bool


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Carved:
    """A part with flaws, and where each face comes from.

    Parameters
    ----------
    vertices_mm, faces
        (V, 3) float64 and (F, 3) int32, closed. Vertices of the part keep every bit.
    instance
        (F,) uint16: 0 where the face is the part's skin, else the number of the flaw, from 1.
    source_face
        (F,) int32: the part's face that it is, or is a piece of; -1 for a flaw's face.
    """

    vertices_mm: Floats
    faces: Ints
    instance: NDArray[np.uint16]
    source_face: Ints


def is_closed(faces: Ints) -> bool:
    """Return whether each edge of a mesh is walked as often one way as the other way.

    Each edge gets a 64-bit number (splitmix64 of its ends), added one way and taken away the
    other way; nothing may be left. An open mesh passes with a chance of 2^-64; sorting the edges
    instead takes ten times as long.
    """
    if not len(faces):
        return False
    corner = faces.astype(np.uint64)
    after = np.roll(corner, -1, axis=1)
    if (corner == after).any():
        return False
    mix = (np.minimum(corner, after) << np.uint64(32)) ^ np.maximum(corner, after)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mix = (mix ^ (mix >> np.uint64(shift))) * np.uint64(factor)
    mix ^= mix >> np.uint64(31)
    forth = corner < after
    return int(mix[forth].sum(dtype=np.uint64)) == int(mix[~forth].sum(dtype=np.uint64))


def _add(manifolds: list[Manifold]) -> Manifold:
    return _checked(Manifold.batch_boolean(manifolds, OpType.Add), "union")


def _checked(manifold: Manifold, what: str) -> Manifold:
    if manifold.status() != Error.NoError:
        raise BooleanError(f"{what}: {manifold.status().name}")
    return manifold


def _manifold(solid: Solid, identity: int) -> Manifold:
    faces = np.array(solid.faces, dtype=np.uint64, order="C")  # manifold3d wants it writable
    mesh = Mesh64(
        np.array(solid.vertices_mm, dtype=np.float64, order="C"),
        faces,
        run_index=np.array([0, 3 * len(faces)], np.uint64),
        run_original_id=np.array([identity], np.uint32),
        # A face of its own each: coplanar neighbours are never merged, so nothing moves.
        face_id=np.arange(len(faces), dtype=np.uint64),
    )
    manifold = _checked(Manifold(mesh), "mesh")
    if manifold.volume() <= 0:
        raise BooleanError("mesh: its volume isn't positive")
    return manifold


def _runs(mesh: Mesh64) -> NDArray[np.int64]:
    """Return the original id (F,) of each face."""
    index = np.array(mesh.run_index, np.int64) // 3
    return np.repeat(np.array(mesh.run_original_id, np.int64), np.diff(index))


def _skin_of(manifold: Manifold, identity: int) -> tuple[Floats, Floats]:
    """Return centres and doubled area vectors (n, 3) of the faces that come from `identity`."""
    mesh = manifold.to_mesh64()
    faces = np.array(mesh.tri_verts, np.int64)[_runs(mesh) == identity]
    a, b, c = (np.array(mesh.vert_properties, np.float64)[faces[:, i], :3] for i in range(3))
    return (a + b + c) / 3, np.cross(b - a, c - a)


def _size(cross: Floats) -> float:
    return float(np.linalg.norm(cross, axis=1).sum() / 2)


class Block:
    """A part held ready for carving.

    Parameters
    ----------
    vertices_mm, faces
        (V, 3) float64 and (F, 3), a closed solid wound outwards.

    Raises
    ------
    BooleanError
        When the mesh isn't that.
    """

    def __init__(self, vertices_mm: Floats, faces: Ints) -> None:
        self._identity = Manifold.reserve_ids(1)
        self._body = _manifold(Solid(vertices_mm=vertices_mm, faces=faces), self._identity)
        self._volume_mm3 = float(self._body.volume())

    def trial(self, cutter: Cutter) -> Change:
        """Carve one flaw into the part's neighbourhood alone, check it, and measure it.

        Raises
        ------
        BooleanError
            When the flaw misses the part, the volumes don't add up, the result isn't closed, or
            the cutter reaches through the air into another wall.
        """
        low, high = cutter.box_mm
        pad = 0.0519 * float(np.max(high - low)) + 0.0317
        box = Manifold.cube(tuple(high - low + 2 * pad)).translate(tuple(low - pad))
        near = _checked(self._body ^ box, "neighbourhood")
        if near.is_empty():
            raise BooleanError("the flaw misses the part")
        local = Solid._of(near)
        if len(cutter.above_mm):
            inside = Inside.of(local.vertices_mm, local.faces).contains(cutter.above_mm)
            if inside.any():
                raise BooleanError("the cutter reaches another wall")
        removed = None if cutter.removed is None else _manifold(cutter.removed, self._other())
        added = None if cutter.added is None else _manifold(cutter.added, self._other())
        result = near
        gone, come, opening, through = 0.0, 0.0, 0.0, False
        if removed is not None:
            result = _checked(result - removed, "difference")
            net = removed if added is None else _checked(removed - added, "difference")
            lost = _checked(near ^ net, "intersection")
            gone = float(lost.volume())
            if not gone > 0:
                raise BooleanError("nothing is removed")
            centres, cross = _skin_of(lost, self._identity)
            opening += _size(cross)
            # A lid closes what the pocket under it opened.
            through = added is None and _far_side(cutter, centres, cross)
        if added is not None:
            result = _checked(result + added, "union")
            gained = _checked(added - near, "difference")
            come = float(gained.volume())
            if not come > 0:
                raise BooleanError("nothing is added")
            opening += _size(_skin_of(gained, self._identity)[1])
        _check(result, float(near.volume()) - gone + come)
        depth = float(-cutter.height_mm.min() if removed is not None else cutter.height_mm.max())
        if through:
            deepest = int(np.argmin(cutter.height_mm))
            depth = min(
                depth, _thickness(local, cutter.skin_mm[deepest], cutter.normals[deepest])
            )
        return Change(
            removed_mm3=gone, added_mm3=come, opening_mm2=opening, depth_mm=depth, through=through
        )

    def carve(self, cutters: list[Cutter], changes: list[Change]) -> Carved:
        """Carve all the flaws, which must lie apart from each other, and check the whole.

        Raises
        ------
        BooleanError
            When a check fails.
        """
        owner: dict[int, int] = {self._identity: 0}
        removed: list[Manifold] = []
        added: list[Manifold] = []
        for number, cutter in enumerate(cutters, start=1):
            for solid, into in ((cutter.removed, removed), (cutter.added, added)):
                if solid is not None:
                    identity = self._other()
                    owner[identity] = number
                    into.append(_manifold(solid, identity))
        body = self._body
        if removed:
            body = _checked(body - _add(removed), "difference")
        if added:
            body = _checked(body + _add(added), "union")
        wanted = self._volume_mm3 + sum(c.added_mm3 - c.removed_mm3 for c in changes)
        mesh = _check(body, wanted)
        runs = _runs(mesh)
        identities, place = np.unique(runs, return_inverse=True)
        unknown = [int(identity) for identity in identities if int(identity) not in owner]
        if unknown:
            raise BooleanError(f"faces of unknown origin: {unknown}")
        instance_of = np.array([owner[int(identity)] for identity in identities], np.uint16)
        instance = instance_of[place]
        source = np.array(mesh.face_id, np.int32)
        source[instance > 0] = -1
        return Carved(
            vertices_mm=np.array(mesh.vert_properties, np.float64)[:, :3],
            faces=np.array(mesh.tri_verts, np.int32),
            instance=instance,
            source_face=source,
        )

    @staticmethod
    def _other() -> int:
        return int(Manifold.reserve_ids(1))


def _check(result: Manifold, wanted_mm3: float) -> Mesh64:
    """Check that a result is there, finite, closed and of the wanted volume; return its mesh."""
    if result.is_empty():
        raise BooleanError("nothing is left")
    mesh = result.to_mesh64()
    if not np.isfinite(mesh.vert_properties).all():
        raise BooleanError("a vertex isn't finite")
    if not is_closed(np.array(mesh.tri_verts, np.int32)):
        raise BooleanError("the result isn't closed")
    tolerance = 1e-9 * max(1.0, float(result.surface_area()))
    if abs(float(result.volume()) - wanted_mm3) > tolerance:
        raise BooleanError("the volumes don't add up")
    return mesh


def _far_side(cutter: Cutter, centres: Floats, cross: Floats) -> bool:
    """Return whether lost skin lies on the far side: facets turned away from the flaw's skin."""
    if not len(cross):
        return False
    nearest = cKDTree(cutter.skin_mm).query(centres)[1]
    size = np.linalg.norm(cross, axis=1)
    away = np.einsum("ij,ij->i", cross, cutter.normals[nearest]) < -0.5 * size
    return bool(size[away].sum() > 1e-6 * size.sum())


def _thickness(solid: Solid, point: Floats, normal: Floats) -> float:
    """Return how far a line from the skin runs along `-normal` until it leaves the solid."""
    a, b, c = (solid.vertices_mm[solid.faces[:, i]] for i in range(3))
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
