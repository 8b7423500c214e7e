"""A part prepared for carving: each flaw is tried in its neighbourhood, then all are carved."""

from contextlib import suppress
from functools import cached_property
from itertools import count

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from defects.carving.booleans import (
    add,
    area_mm2,
    checked,
    checked_mesh,
    faces_of,
    labelled,
    manifold,
    mesh_manifold,
    new_identity,
    skin_of,
    solid_of,
)
from defects.carving.closed_patch import ClosedPatch, FaceBoxes, Unclosable, close_off
from defects.carving.point_in_mesh import Inside
from defects.carving.seam import StandIn
from defects.carving.solid import (
    VOLUME_TOLERANCE_MM,
    BooleanError,
    CarvedPatch,
    Change,
    Cutter,
    Solid,
)
from defects.carving.stitch import Carved, StitchError, Stitches
from defects.carving.wall_thickness import on_far_side, thickness_mm

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

MARGIN = 0.0519  # of a cutter's size: how far its neighbourhood reaches around it
MARGIN_MM = 0.0317  # and at least; neither is likely to meet a part's own planes


class Block:
    """A part prepared for carving.

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
        self._identity = new_identity()
        self._boxes = FaceBoxes(vertices_mm, faces)

    @cached_property
    def _body(self) -> Manifold:
        """The whole part, for what can't be carved locally."""
        return manifold(self._solid, self._identity)

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
        return mesh_manifold(closed.vertices_mm, closed.faces, self._identity), closed

    def trial(self, cutter: Cutter) -> Change:
        """Carve one flaw into its neighbourhood only, check it, and measure it.

        Raises
        ------
        BooleanError
            When the flaw misses the part, the volumes don't add up, the result isn't closed, or
            the cutter reaches through the air into another wall.
        """
        body, closed = self._near(cutter)
        local = solid_of(body)
        if len(cutter.above_mm):
            inside = Inside.of(local.vertices_mm, local.faces).contains(cutter.above_mm)
            if inside.any():
                raise BooleanError("the cutter reaches another wall")
        if closed is not None and cutter.seam is not None:
            with suppress(BooleanError):  # the whole solids can do what the seam alone can't
                return self._seamed(body, closed, cutter)
        flaw = new_identity()  # both its solids are of one identity: their faces get one label
        result = body
        gone, come, opening, through = 0.0, 0.0, 0.0, False
        added = None if cutter.added is None else manifold(cutter.added, flaw)
        if cutter.removed is not None:
            taken, result = body.split(manifold(cutter.removed, flaw))
            lost = checked(taken if added is None else taken - added, "intersection")
            gone = float(lost.volume())
            if not gone > 0:
                raise BooleanError("nothing is removed")
            centres, cross = skin_of(lost, self._identity)
            opening += area_mm2(cross)
            # A lid closes what the pocket under it opened.
            through = added is None and on_far_side(
                cutter.skin_mm, cutter.normals, centres, cross
            )
        if added is not None:
            result = checked(result + added, "union")
            gained = checked(added - body, "difference")
            come = float(gained.volume())
            if not come > 0:
                raise BooleanError("nothing is added")
            opening += area_mm2(skin_of(gained, self._identity)[1])
        mesh = checked_mesh(result, float(body.volume()) - gone + come)
        depth = float(-cutter.height_mm.min() if cutter.removed else cutter.height_mm.max())
        if through:
            deepest = int(np.argmin(cutter.height_mm))
            skin, normal = cutter.skin_mm[deepest], cutter.normals[deepest]
            depth = min(depth, thickness_mm(local.vertices_mm, local.faces, skin, normal))
        patch = None
        if closed is not None:
            carved = labelled(mesh, {self._identity: 0, flaw: 1})
            change_mm3 = float(result.volume()) - float(body.volume())
            patch = CarvedPatch(closed=closed, carved=carved, change_mm3=change_mm3)
        return Change(
            removed_mm3=gone, added_mm3=come, opening_mm2=opening, depth_mm=depth,
            through=through, patch=patch,
        )  # fmt: skip

    def _seamed(self, body: Manifold, closed: ClosedPatch, cutter: Cutter) -> Change:
        """Carve a flaw by the faces alone that meet the skin, and measure it.

        Raises
        ------
        BooleanError
            When a check fails.
        """
        seam = cutter.seam() if cutter.seam is not None else None
        if seam is None:
            raise BooleanError("no seam")
        flaw = new_identity()
        lost = checked(body ^ manifold(seam.taken.solid, flaw), "intersection")
        gone = float(lost.volume())
        seam.taken.check(faces_of(lost.to_mesh64(), flaw)[1])
        gone += seam.taken.between.volume_mm3
        button = manifold(seam.raised.solid, flaw)
        raised = checked(body + button, "union")
        mesh = checked_mesh(raised, float(raised.volume()))
        carved = labelled(mesh, {self._identity: 0, flaw: 1})
        carved, _ = seam.raised.set_in(carved, *faces_of(mesh, flaw))
        grown_mm3 = float(raised.volume() - body.volume()) + seam.raised.between.volume_mm3
        opening, change_mm3 = _change(closed, carved, cutter, grown_mm3, raised.surface_area())
        if not gone > 0:
            raise BooleanError("nothing is removed")
        if not change_mm3 + gone > 0:
            raise BooleanError("nothing is added")
        return Change(
            removed_mm3=gone,
            added_mm3=change_mm3 + gone,
            opening_mm2=opening,
            depth_mm=float(-cutter.height_mm.min()),
            through=False,
            patch=CarvedPatch(closed=closed, carved=carved, change_mm3=change_mm3),
            seam=seam,
        )

    def _near(self, cutter: Cutter) -> tuple[Manifold, ClosedPatch | None]:
        """Return what is the part around a cutter: a closed patch, else the part within a box."""
        box_mm = _reach(cutter)
        try:
            return self._around(_wider(box_mm))
        except BooleanError:
            box = Manifold.cube(tuple(np.diff(box_mm, axis=0)[0])).translate(tuple(box_mm[0]))
            near = checked(self._body ^ box, "neighbourhood")
            if near.is_empty():
                raise BooleanError("the flaw misses the part") from None
            return near, None

    def carve(self, cutters: list[Cutter], changes: list[Change]) -> Carved:
        """Carve all flaws, whose reaches must be disjoint, and check the result.

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
                try:
                    carved = self._cut(body, some, seams=True)
                except BooleanError:
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

    def _cut(
        self, body: Manifold, flaws: list[tuple[int, Cutter, Change]], *, seams: bool = False
    ) -> Carved:
        """Carve numbered flaws into a body whose faces are of the part's identity."""
        owner: dict[int, int] = {self._identity: 0}
        removed: list[Manifold] = []
        added: list[Manifold] = []
        set_in: list[tuple[int, StandIn]] = []
        wanted = float(body.volume())
        for number, cutter, change in flaws:
            wanted += change.added_mm3 - change.removed_mm3
            solids = ((cutter.removed, removed), (cutter.added, added))
            if seams and change.seam is not None:
                solids = ((None, removed), (change.seam.raised.solid, added))
                wanted -= change.seam.raised.between.volume_mm3
            for solid, into in solids:
                if solid is not None:
                    identity = new_identity()
                    owner[identity] = number
                    into.append(manifold(solid, identity))
            if seams and change.seam is not None:
                set_in.append((identity, change.seam.raised))
        if removed:
            body = checked(body - add(removed), "difference")
        if added:
            body = checked(body + add(added), "union")
        mesh = checked_mesh(body, wanted)
        carved, place = labelled(mesh, owner), np.arange(len(mesh.tri_verts))
        for identity, stand_in in set_in:
            rows, source = faces_of(mesh, identity)
            carved, kept = stand_in.set_in(carved, place[rows], source)
            place = np.where(kept, np.cumsum(kept) - 1, -1)[place]
        return carved


def _change(
    closed: ClosedPatch, carved: Carved, cutter: Cutter, grown_mm3: float, area_mm2: float
) -> tuple[float, float]:
    """Return the area of a patch's skin that went, and by how much its volume grew.

    Raises
    ------
    BooleanError
        When that isn't `grown_mm3`, the difference of volumes, to within the tolerance.
    """
    deepest = int(np.argmin(cutter.height_mm))
    opening, change_mm3 = closed.change(
        carved.vertices_mm, carved.faces, carved.source_face, cutter.skin_mm[deepest]
    )
    if abs(grown_mm3 - change_mm3) > VOLUME_TOLERANCE_MM * max(1.0, area_mm2):
        raise BooleanError("the volumes don't add up")
    return opening, change_mm3


def _reach(cutter: Cutter) -> Floats:
    """Return the box (2, 3) around a cutter in which it is tried."""
    low, high = cutter.box_mm
    pad = MARGIN * float(np.max(high - low)) + MARGIN_MM
    return np.stack([low - pad, high + pad])


def _wider(box_mm: Floats) -> Floats:
    return np.stack([box_mm[0] - MARGIN_MM, box_mm[1] + MARGIN_MM])
