"""Closed solids, cutters of flaws, and the change of a part by a flaw."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from defects.carving.bounding_box import bounding_box
from defects.carving.closed_patch import ClosedPatch
from defects.carving.stitch import Carved, is_closed

if TYPE_CHECKING:
    from defects.carving.seam import Seam

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

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
        about = self.vertices_mm - self.vertices_mm[0]
        a, b, c = (about.take(self.faces[:, i], axis=0) for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    @property
    def closed(self) -> bool:
        """Return whether each edge has as many faces one way as the other way."""
        return is_closed(self.faces)

@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Cutter:
    """The solids of a flaw: `removed` is subtracted, then `added` is united.

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
    seam
        Makes what of the solids meets the part's skin, for cheaper booleans; None: all may.
    """

    removed: Solid | None
    added: Solid | None
    skin_mm: Floats
    normals: Floats
    height_mm: Floats
    above_mm: Floats
    seam: "Callable[[], Seam | None] | None" = field(default=None, repr=False)

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Return the solids that exist."""
        return tuple(solid for solid in (self.removed, self.added) if solid is not None)

    @property
    def box_mm(self) -> Floats:
        """Return the least and the greatest corner (2, 3) of all the solids."""
        return bounding_box(np.concatenate([solid.vertices_mm for solid in self.solids]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """Change of the part by one flaw.

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
    seam
        What was carved, where it was of the seam alone.
    """

    removed_mm3: float
    added_mm3: float
    opening_mm2: float
    depth_mm: float
    through: bool
    patch: "CarvedPatch | None" = field(default=None, repr=False, compare=False)
    seam: "Seam | None" = field(default=None, repr=False, compare=False)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CarvedPatch:
    """Result of a trial around one flaw, for stitching into the part.

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
            When the patch's change differs from that of the flaw.
        """
        area = float(np.ptp(self.closed.vertices_mm, axis=0).max()) ** 2
        wanted_mm3 = change.added_mm3 - change.removed_mm3
        if abs(self.change_mm3 - wanted_mm3) > VOLUME_TOLERANCE_MM * max(1.0, area):
            raise BooleanError("the volumes don't add up")
        return replace(self.carved, instance=self.carved.instance * np.uint16(instance))
