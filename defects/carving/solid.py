"""Closed solids and what is carved out of them and put onto them: the one user of manifold3d."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import Any, Self

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray

from defects.carving.closed_patch import ClosedPatch, FaceBoxes, Unclosable, close_off
from defects.carving.point_in_mesh import Inside
from defects.carving.stitch import Carved, StitchError, Stitches, is_closed
from defects.carving.wall_thickness import on_far_side, thickness_mm

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

MARGIN = 0.0519  # of a cutter's size: how far its neighbourhood reaches around it
MARGIN_MM = 0.0317  # and at least; neither is likely to meet a part's own planes
VOLUME_TOLERANCE_MM = 1e-9  # of volumes that must add up, for each mm² of surface


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
    patch
        The faces around the flaw as carved, where they could be closed off.
    """

    removed_mm3: float
    added_mm3: float
    opening_mm2: float
    depth_mm: float
    through: bool
    patch: "CarvedPatch | None" = field(default=None, repr=False, compare=False)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CarvedPatch:
    """What a trial made of the faces around one flaw, ready to be stitched back.

    Parameters
    ----------
    closed, carved
        The faces, closed off, and what they were carved into; the flaw is instance 1.
    change_mm3
        By how much the patch's volume grew.
    """

    closed: ClosedPatch
    carved: Carved
    change_mm3: float

    def of(self, instance: int, change: Change) -> Carved:
        """Return the carved patch with the flaw's number in the part.

        Raises
        ------
        BooleanError
            When the patch doesn't change by what the flaw is said to change.
        """
        area = float(np.ptp(self.closed.vertices_mm, axis=0).max()) ** 2
        wanted_mm3 = change.added_mm3 - change.removed_mm3
        if abs(self.change_mm3 - wanted_mm3) > VOLUME_TOLERANCE_MM * max(1.0, area):
            raise BooleanError("the volumes don't add up")
        return replace(self.carved, instance=self.carved.instance * np.uint16(instance))


def _add(manifolds: list[Manifold]) -> Manifold:
    return _checked(Manifold.batch_boolean(manifolds, OpType.Add), "union")


def _checked(manifold: Manifold, what: str) -> Manifold:
    if manifold.status() != Error.NoError:
        raise BooleanError(f"{what}: {manifold.status().name}")
    return manifold


def _manifold(solid: Solid, identity: int) -> Manifold:
    manifold = _mesh(solid.vertices_mm, solid.faces, identity)
    if manifold.volume() <= 0:
        raise BooleanError("mesh: its volume isn't positive")
    return manifold


def _mesh(vertices_mm: Floats, faces: NDArray[np.integer[Any]], identity: int) -> Manifold:
    mesh = Mesh64(
        np.array(vertices_mm, dtype=np.float64, order="C"),  # manifold3d wants them writable
        np.array(faces, dtype=np.uint64, order="C"),
        run_index=np.array([0, 3 * len(faces)], np.uint64),
        run_original_id=np.array([identity], np.uint32),
        # A face of its own each: coplanar neighbours are never merged, so nothing moves.
        face_id=np.arange(len(faces), dtype=np.uint64),
    )
    return _checked(Manifold(mesh), "mesh")


def _runs(mesh: Mesh64) -> NDArray[np.int64]:
    """Return the original id (F,) of each face."""
    index = np.array(mesh.run_index, np.int64) // 3
    return np.repeat(np.array(mesh.run_original_id, np.int64), np.diff(index))


def _labelled(mesh: Mesh64, owner: dict[int, int]) -> Carved:
    """Return a carved mesh with the flaw that each face belongs to, by its identity; 0 = skin."""
    identities, place = np.unique(_runs(mesh), return_inverse=True)
    unknown = [int(identity) for identity in identities if int(identity) not in owner]
    if unknown:
        raise BooleanError(f"faces of unknown origin: {unknown}")
    instance = np.array([owner[int(identity)] for identity in identities], np.uint16)[place]
    source = np.array(mesh.face_id, np.int32)
    source[instance > 0] = -1
    return Carved(
        vertices_mm=np.array(mesh.vert_properties, np.float64)[:, :3],
        faces=np.array(mesh.tri_verts, np.int32),
        instance=instance,
        source_face=source,
    )


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
        self._solid = Solid(vertices_mm=vertices_mm, faces=faces)
        if not self._solid.closed:
            raise BooleanError("mesh: NotManifold")
        if not self._solid.volume_mm3 > 0:
            raise BooleanError("mesh: its volume isn't positive")
        self._identity = self._other()
        self._boxes = FaceBoxes(vertices_mm, faces)

    @cached_property
    def _body(self) -> Manifold:
        """The whole part, for what can't be carved locally."""
        return _manifold(self._solid, self._identity)

    def _around(self, box_mm: Floats) -> tuple[Manifold, ClosedPatch]:
        """Return what is the part within a box, made of the faces there alone.

        Raises
        ------
        BooleanError
            When they can't be closed off.
        """
        try:
            closed = close_off(
                self._solid.vertices_mm, self._solid.faces, self._boxes.meeting(box_mm), box_mm
            )
        except Unclosable as error:
            raise BooleanError(f"neighbourhood: {error}") from None
        return _mesh(closed.vertices_mm, closed.faces, self._identity), closed

    def trial(self, cutter: Cutter) -> Change:
        """Carve one flaw into the part's neighbourhood alone, check it, and measure it.

        Raises
        ------
        BooleanError
            When the flaw misses the part, the volumes don't add up, the result isn't closed, or
            the cutter reaches through the air into another wall.
        """
        body, closed = self._near(cutter)
        local = Solid._of(body)
        if len(cutter.above_mm):
            inside = Inside.of(local.vertices_mm, local.faces).contains(cutter.above_mm)
            if inside.any():
                raise BooleanError("the cutter reaches another wall")
        flaw = self._other()  # both its solids are of one identity: their faces get one label
        result = body
        gone, come, opening, through = 0.0, 0.0, 0.0, False
        added = None if cutter.added is None else _manifold(cutter.added, flaw)
        if cutter.removed is not None:
            taken, result = body.split(_manifold(cutter.removed, flaw))
            lost = _checked(taken if added is None else taken - added, "intersection")
            gone = float(lost.volume())
            if not gone > 0:
                raise BooleanError("nothing is removed")
            centres, cross = _skin_of(lost, self._identity)
            opening += _size(cross)
            # A lid closes what the pocket under it opened.
            through = added is None and on_far_side(
                cutter.skin_mm, cutter.normals, centres, cross
            )
        if added is not None:
            result = _checked(result + added, "union")
            gained = _checked(added - body, "difference")
            come = float(gained.volume())
            if not come > 0:
                raise BooleanError("nothing is added")
            opening += _size(_skin_of(gained, self._identity)[1])
        mesh = _check(result, float(body.volume()) - gone + come)
        depth = float(-cutter.height_mm.min() if cutter.removed else cutter.height_mm.max())
        if through:
            deepest = int(np.argmin(cutter.height_mm))
            skin, normal = cutter.skin_mm[deepest], cutter.normals[deepest]
            depth = min(depth, thickness_mm(local.vertices_mm, local.faces, skin, normal))
        patch = None
        if closed is not None:
            carved = _labelled(mesh, {self._identity: 0, flaw: 1})
            change_mm3 = float(result.volume()) - float(body.volume())
            patch = CarvedPatch(closed=closed, carved=carved, change_mm3=change_mm3)
        return Change(
            removed_mm3=gone, added_mm3=come, opening_mm2=opening, depth_mm=depth,
            through=through, patch=patch,
        )  # fmt: skip

    def _near(self, cutter: Cutter) -> tuple[Manifold, ClosedPatch | None]:
        """Return what is the part around a cutter: a closed patch, else the part within a box."""
        box_mm = _reach(cutter)
        try:
            return self._around(_wider(box_mm))
        except BooleanError:
            box = Manifold.cube(tuple(np.diff(box_mm, axis=0)[0])).translate(tuple(box_mm[0]))
            near = _checked(self._body ^ box, "neighbourhood")
            if near.is_empty():
                raise BooleanError("the flaw misses the part") from None
            return near, None

    def carve(self, cutters: list[Cutter], changes: list[Change]) -> Carved:
        """Carve all the flaws, which must lie apart from each other, and check the result.

        Locally, or where that fails from the whole part.

        Raises
        ------
        BooleanError
            When a check fails.
        """
        try:
            return self.carve_locally(cutters, changes)
        except BooleanError:
            return self.carve_whole(cutters, changes)

    def carve_locally(self, cutters: list[Cutter], changes: list[Change]) -> Carved:
        """Carve the flaws into the faces within their reach and stitch these back.

        Raises
        ------
        BooleanError
            When a check fails.
        """
        stitches = Stitches(self._solid.vertices_mm, self._solid.faces)
        for box_mm, members in self._apart(cutters):
            alone = changes[members[0]]
            if len(members) == 1 and alone.patch is not None:
                closed, carved = alone.patch.closed, alone.patch.of(members[0] + 1, alone)
            else:
                body, closed = self._around(box_mm)
                some = [(number + 1, cutters[number], changes[number]) for number in members]
                carved = self._cut(body, some)
            try:
                stitches.put(closed, carved)
            except StitchError as error:
                raise BooleanError(str(error)) from None
        return stitches.sewn()

    def carve_whole(self, cutters: list[Cutter], changes: list[Change]) -> Carved:
        """Carve the flaws with booleans of the whole part.

        Raises
        ------
        BooleanError
            When a check fails.
        """
        numbers = range(1, len(cutters) + 1)
        return self._cut(self._body, list(zip(numbers, cutters, changes, strict=True)))

    def _apart(self, cutters: list[Cutter]) -> list[tuple[Floats, list[int]]]:
        """Return boxes that no face meets two of, each with the numbers of the flaws in it."""
        waiting = [(_wider(_reach(cutter)), [i]) for i, cutter in enumerate(cutters)]
        owner = np.full(len(self._solid.faces), -1, np.int32)
        found: dict[int, tuple[Floats, list[int]]] = {}
        for name in count():
            if not waiting:
                break
            box_mm, members = waiting.pop()
            patch = self._boxes.meeting(box_mm)
            met = [int(other) for other in np.unique(owner[patch]) if other in found]
            if not met:
                owner[patch] = name
                found[name] = box_mm, sorted(members)
                continue
            both = [(box_mm, members), *(found.pop(other) for other in met)]
            corners = np.concatenate([box for box, _ in both])
            whole = np.stack([corners.min(axis=0), corners.max(axis=0)])
            waiting.append((whole, [number for _, some in both for number in some]))
        return list(found.values())

    def _cut(self, body: Manifold, flaws: list[tuple[int, Cutter, Change]]) -> Carved:
        """Carve numbered flaws into a body whose faces are of the part's identity."""
        owner: dict[int, int] = {self._identity: 0}
        removed: list[Manifold] = []
        added: list[Manifold] = []
        wanted = float(body.volume())
        for number, cutter, change in flaws:
            wanted += change.added_mm3 - change.removed_mm3
            for solid, into in ((cutter.removed, removed), (cutter.added, added)):
                if solid is not None:
                    identity = self._other()
                    owner[identity] = number
                    into.append(_manifold(solid, identity))
        if removed:
            body = _checked(body - _add(removed), "difference")
        if added:
            body = _checked(body + _add(added), "union")
        return _labelled(_check(body, wanted), owner)

    @staticmethod
    def _other() -> int:
        return int(Manifold.reserve_ids(1))


def _reach(cutter: Cutter) -> Floats:
    """Return the box (2, 3) around a cutter in which it is tried."""
    low, high = cutter.box_mm
    pad = MARGIN * float(np.max(high - low)) + MARGIN_MM
    return np.stack([low - pad, high + pad])


def _wider(box_mm: Floats) -> Floats:
    return np.stack([box_mm[0] - MARGIN_MM, box_mm[1] + MARGIN_MM])


def _check(result: Manifold, wanted_mm3: float) -> Mesh64:
    """Check that a result is there, finite, closed and of the wanted volume; return its mesh."""
    if result.is_empty():
        raise BooleanError("nothing is left")
    mesh = result.to_mesh64()
    if not np.isfinite(mesh.vert_properties).all():
        raise BooleanError("a vertex isn't finite")
    if not is_closed(np.array(mesh.tri_verts, np.int32)):
        raise BooleanError("the result isn't closed")
    tolerance = VOLUME_TOLERANCE_MM * max(1.0, float(result.surface_area()))
    if abs(float(result.volume()) - wanted_mm3) > tolerance:
        raise BooleanError("the volumes don't add up")
    return mesh
