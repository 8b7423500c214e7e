"""A part with its flaws: the solid, the origin of each face, and a record of each flaw."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from defects.carving.point_in_mesh import Inside, in_boxes
from defects.carving.solid import Cutter
from pipeline.parts.part import Part

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Flaw:
    """The record of one flaw in one part.

    Parameters
    ----------
    instance
        Its number in the part, from 1; what masks of instances hold.
    kind, class_id, tier
        What it is. `tier` is empty where the plan has none.
    source
        Name of the real flaw in the bank that it is taken from; empty for other kinds.
    parameters
        Its drawn sizes by name.
    position_mm, normal, heading_rad, triangle
        Its site on the unflawed part, part frame.
    removed_mm3, added_mm3, opening_mm2, depth_mm, through
        See `defects.carving.solid.Change`.
    seed, attempt
        With the sizes and the site they rebuild it alone, see
        `pipeline.injection.inject.cutter_of`.
    """

    instance: int
    kind: str
    class_id: int
    tier: str
    source: str
    parameters: dict[str, float]
    position_mm: Floats
    normal: Floats
    heading_rad: float
    triangle: int
    removed_mm3: float
    added_mm3: float
    opening_mm2: float
    depth_mm: float
    through: bool
    seed: int
    attempt: int


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FlawedPart:
    """A part with its flaws: a closed solid whose faces state the flaw that made them.

    Parameters
    ----------
    part
        The part before.
    vertices_mm, faces
        (V, 3) float64 and (F, 3) int32. Vertices of the part that are still there keep every bit.
    instance
        (F,) uint16: 0 where a face is the part's skin, else the flaw's number.
    source_face
        (F,) int32: which face of `part` it is, or is a piece of; -1 for a flaw's face.
    flaws
        Records, `flaws[i].instance == i + 1`.
    cutters
        What was carved, one for each of `flaws`.
    redrawn
        How often a flaw was drawn again because its boolean failed.
    misplaced
        How often a flaw was drawn again because it didn't fit where it was.
    dropped
        Why flaws were given up, one line for each.
    solids
        What `removed_at` asks: the removed and the added solid of each of `cutters`.
    """

    part: Part
    vertices_mm: Floats
    faces: NDArray[np.int32]
    instance: NDArray[np.uint16]
    source_face: NDArray[np.int32]
    flaws: tuple[Flaw, ...]
    cutters: tuple[Cutter, ...]
    redrawn: int
    misplaced: int
    dropped: tuple[str, ...]
    solids: tuple[tuple[Inside | None, Inside | None], ...]

    @property
    def classes(self) -> NDArray[np.uint8]:
        """Return the class (k + 1,) of each instance; instance 0, the skin, is class 0."""
        return np.array([0, *(flaw.class_id for flaw in self.flaws)], np.uint8)

    def removed_at(self, points_mm: Floats) -> NDArray[np.uint16]:
        """Return the flaw that removed the material at each point.

        Parameters
        ----------
        points_mm
            (k, 3) part frame; points that aren't finite are in no flaw.

        Returns
        -------
        instance
            (k,) uint16, 0 where nothing was removed.
        """
        points = np.ascontiguousarray(points_mm, np.float64)
        owner = np.zeros(len(points), np.uint16)
        carving = [i for i, cutter in enumerate(self.cutters) if cutter.removed is not None]
        if not carving:
            return owner
        boxes = np.stack([self.cutters[i].box_mm.ravel() for i in carving])
        start, member = in_boxes(points, boxes)
        for place, i in enumerate(carving):
            near = member[start[place] : start[place + 1]]
            removed, added = self.solids[i]
            if removed is not None:
                near = near[removed.contains(points[near])]
            if added is not None:
                near = near[~added.contains(points[near])]
            owner[near] = self.flaws[i].instance
        return owner
