"""A lid: the skin given another surface, with what goes above it and what comes below it."""

from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from defects.carving.seam import Seam, StandIn
from defects.carving.solid import Cutter
from defects.shape.patch import SPARED, Patch

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]

# Where a flat top stands in for a lid, and what goes ends. A facet that reaches over both bounds
# of a pair keeps all its corners, so that only the wanted surface itself crosses the skin.
CREST, END = 0.5, 0.8  # of the way from the hollow to the lid's end
DEEP, FLANK = 0.15, 0.05  # of the hollow's depth


def reshape(
    lid: Patch,
    lid_height_mm: Floats,
    pocket: Patch | None,
    floor_mm: Floats | None,
    margin_mm: float,
    sagitta_mm: float = 0.0,
    share: Floats | None = None,
    sheet_mm: Floats | None = None,
) -> Cutter:
    """Give the skin another surface.

    What lies above the wanted surface goes, and a lid with the wanted surface on top comes,
    so that removed and added faces never nearly coincide: the pocket is cut `margin_mm`
    deeper than wanted, see `eased`, and the lid is twice that thick. The wanted surface must cross
    the skin at an angle and end below it.

    Parameters
    ----------
    lid, lid_height_mm
        The whole footprint and (n,) the wanted surface above the skin along the local normal.
    pocket, floor_mm
        What is removed: over which patch, and (n,) from which height over the skin on. None:
        nothing.
    margin_mm
        See above.
    sagitta_mm
        How far facets may stand off the wanted surface.
    share
        (n,) of a hollow with a rim all around: 0 in the hollow, from there to the lid's end rising
        to 1. With it, the booleans are of the seams alone.
    sheet_mm
        (n,) thickness of a sheet whose far skin moves, too; None: the lid is `2 * margin_mm`
        thick.
    """
    seen = SPARED * sagitta_mm
    top = lid_height_mm > 0.2 * max(float(lid_height_mm.max()), 1e-9)
    above = lid.at(lid_height_mm)[top]
    rise = float(max(lid_height_mm.max(), 0.0)) + 2 * margin_mm
    removed = None
    if pocket is not None and floor_mm is not None:
        high = np.full(len(pocket.skin_mm), rise)
        removed = pocket.solid(floor_mm, high, loose_mm=(0.25 * margin_mm, margin_mm))
        above = np.concatenate([above, pocket.at(high)[pocket._used()]])
    # A sheet's far skin is seen; a lid's underside only has to stay below the pocket's floor.
    if sheet_mm is None:
        low, loose = np.minimum(lid_height_mm, 0.0) - 2 * margin_mm, 0.4 * margin_mm
    else:
        low, loose = _far_mm(lid_height_mm, sheet_mm, share), seen
    seam = None
    if share is not None and sagitta_mm > 0:
        seam = partial(
            _seam, lid, lid_height_mm, share, rise_mm=rise, margin_mm=margin_mm, seen_mm=seen,
            sheet_mm=sheet_mm,
        )  # fmt: skip
    return Cutter(
        removed=removed,
        added=lid.solid(low, lid_height_mm, loose_mm=(loose, seen)),
        skin_mm=lid.skin_mm,
        normals=lid.normals,
        height_mm=lid_height_mm,
        above_mm=above,
        seam=seam,
    )


def eased(height_mm: Floats, share: Floats, margin_mm: float) -> Floats:
    """Return a pocket's floor over the skin, a margin deeper than a wanted surface (n,).

    `share` is 0 where the wanted surface lies below the skin. From there to the lid's end it rises
    to 1, and the floor out of the skin, so that the pocket's walls stand in the air.
    """
    return np.where(share > 0, (2 * share - 1) * margin_mm, np.minimum(height_mm, 0) - margin_mm)


def _far_mm(height_mm: Floats, sheet_mm: Floats, share: Floats | None) -> Floats:
    """Return the underside of a sheet's lid over the skin.

    Past the hollow the far skin stays, and the lid ends inside the sheet.
    """
    hollow = np.ones(len(height_mm), np.bool_) if share is None else share <= 0
    return np.where(hollow, height_mm, np.abs(height_mm)) - sheet_mm


def _seam(
    lid: Patch,
    height_mm: Floats,
    share: Floats,
    *,
    rise_mm: float,
    margin_mm: float,
    seen_mm: float,
    sheet_mm: Floats | None,
) -> Seam | None:
    """Return what of a lid meets the skin; None where the lid's grid has no blocks."""
    fine = None if lid.grid is None else lid.grid.needed(lid.at(height_mm), seen_mm)
    if lid.grid is None or fine is None:
        return None
    facets, nowhere = lid.grid.triangles(fine), np.zeros(len(share), np.bool_)
    inward = _at_corners(share <= 0, facets)
    outward = _at_corners(share > END, facets)
    if (inward & outward).any():
        return None
    # The button: the wanted surface outside the crest, a flat top in the air within.
    within = share <= CREST
    within[facets[outward]] = False
    flat = np.where(within, rise_mm, height_mm)
    top = _Side.of(lid, height_mm, flat, within, fine, margin_mm)
    if sheet_mm is None:
        low_mm = np.minimum(flat, 0.0) - 2 * margin_mm
        low = _Side.hidden(lid, low_mm, 0.4 * margin_mm)
    else:
        far_mm = _far_mm(height_mm, sheet_mm, share)
        out = (share <= 0) & (height_mm < -margin_mm)
        flat = np.where(out, -margin_mm - sheet_mm, far_mm)
        far = lid.grid.needed(lid.at(far_mm), seen_mm)
        assert far is not None
        low = _Side.of(lid, far_mm, flat, out, far, 0.25 * margin_mm)
    # What goes: down to the wanted surface at the hollow's edge, and to a level further in.
    beyond = share > 0
    beyond[facets[inward]] = False
    bottom_mm = float(height_mm.min())
    deep = (share <= 0) & (height_mm < DEEP * bottom_mm)
    if sheet_mm is not None:
        deep = nowhere.copy()  # its far skin may run through it
    deep[facets[_at_corners(height_mm > FLANK * bottom_mm, facets)]] = False
    floor = np.where(beyond, rise_mm - margin_mm, np.where(deep, DEEP * bottom_mm, height_mm))
    bottom = _Side.of(lid, height_mm, floor, deep, fine, 0.25 * margin_mm, unseen=beyond)
    roof = _Side.hidden(lid, np.full(len(share), rise_mm), margin_mm)
    raised = _stand_in(lid, low, top, whole=share <= END)
    taken = _stand_in(lid, bottom, roof)
    return Seam(raised=raised, taken=taken) if raised.fits and taken.fits else None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Side:
    """One side of a solid over a patch, with what stands in for its finer faces.

    Parameters
    ----------
    places_mm, faces
        (n, 3) of the patch's points, and (k, 3).
    seen, standing
        (k,) which faces a result may show; which stand in for `finer`.
    finer, finer_mm, moved
        (m, 3) faces, (n, 3) places and (n,) where these differ from `places_mm`.
    """

    places_mm: Floats
    faces: Ints
    seen: Bools
    standing: Bools
    finer: Ints
    finer_mm: Floats
    moved: Bools

    @classmethod
    def of(
        cls,
        lid: Patch,
        wanted_mm: Floats,
        instead_mm: Floats,
        moved: Bools,
        fine: Bools,
        instead_loose_mm: float,
        unseen: Bools | None = None,
    ) -> Self:
        """Thin a wanted surface (n,) that others stand in for where it is `moved` (n,).

        `fine` states which places of the grid the wanted surface needs. Where neither `moved` nor
        `unseen`, the faces are those of the wanted surface, bit by bit.
        """
        grid = lid.grid
        assert grid is not None
        wanted, instead = lid.at(wanted_mm), lid.at(instead_mm)
        needed, finer = fine, np.zeros((0, 3), np.int32)
        if moved.any():
            coarse = grid.needed(instead, instead_loose_mm, moved)
            assert coarse is not None
            needed = grid.reached(fine, ~moved) | (fine & coarse)
            finer, own = grid.apart(fine, needed)
            finer = finer[own | _at_corners(moved, finer)]
        fewer = needed
        if unseen is not None and not unseen.all():
            coarse = grid.needed(instead, instead_loose_mm, unseen)
            assert coarse is not None
            fewer = grid.reached(needed, ~unseen) | (needed & coarse)
        faces, own = grid.apart(fewer, fine)
        standing = (own | _at_corners(moved, faces)) & ~grid.apart(fewer, needed)[1]
        hidden = np.zeros(len(lid.skin_mm), np.bool_) if unseen is None else unseen
        seen = ~_at_corners(hidden, faces)
        return cls(
            places_mm=instead, faces=faces, seen=seen, standing=standing,
            finer=finer, finer_mm=wanted, moved=moved,
        )  # fmt: skip

    @classmethod
    def hidden(cls, lid: Patch, height_mm: Floats, loose_mm: float) -> Self:
        """Thin a surface (n,) that no result may show."""
        grid = lid.grid
        assert grid is not None
        places = lid.at(height_mm)
        faces = grid.thinned(places, loose_mm)
        none, nowhere = np.zeros(len(faces), np.bool_), np.zeros(len(places), np.bool_)
        return cls(
            places_mm=places, faces=faces, seen=none, standing=none,
            finer=np.zeros((0, 3), np.int32), finer_mm=places, moved=nowhere,
        )  # fmt: skip


def _at_corners(there: Bools, faces: Ints) -> Bools:
    """Return which faces (k, 3) have a corner among the points that are `there` (n,)."""
    a, b, c = (there[faces[:, k]] for k in range(3))
    return np.asarray(a | b | c)


def _stand_in(lid: Patch, low: _Side, high: _Side, whole: Bools | None = None) -> StandIn:
    """Join two sides to a solid, with the finer faces of both in its numbers.

    The upper side's faces between points that are `whole` (n,) may not be crossed.
    """
    solid, number = lid.closed((low.places_mm, low.faces), (high.places_mm, high.faces))
    walls = np.zeros(len(solid.faces) - len(low.faces) - len(high.faces), np.bool_)
    faces, further, count = [], [], len(solid.vertices_mm)
    top = np.zeros(len(high.faces), np.bool_) if whole is None else ~_at_corners(~whole, high.faces)
    for side, own in ((low, number[0]), (high, number[1])):
        put = np.zeros(len(own), np.bool_)
        put[side.finer] = True
        put &= side.moved | (own < 0)
        own = own.astype(np.int64)
        own[put] = count + np.arange(int(put.sum()))
        count += int(put.sum())
        faces.append(own[side.finer])
        further.append(side.finer_mm[put])
    faces[0] = faces[0][:, ::-1]
    return StandIn(
        solid=solid,
        seen=np.concatenate([low.seen, high.seen, walls]),
        standing=np.concatenate([low.standing, high.standing, walls]),
        whole=np.concatenate([low.standing, top | high.standing, walls]),
        faces=np.concatenate(faces),
        further_mm=np.concatenate(further),
    )
