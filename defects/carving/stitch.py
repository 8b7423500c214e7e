"""Carved patches put back into the solid that they were taken from."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from defects.carving.closed_patch import ClosedPatch

Floats = NDArray[np.float64]
Faces = NDArray[np.integer[Any]]


class StitchError(RuntimeError):
    """A carved patch does not fit its place; the message is one line."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Carved:
    """A part with flaws, and the origin of each face.

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
    faces: NDArray[np.int32]
    instance: NDArray[np.uint16]
    source_face: NDArray[np.int32]


def is_closed(faces: Faces) -> bool:
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


def same_corners(one_mm: Floats, other_mm: Floats) -> NDArray[np.bool_]:
    """Return which corners of triangles (n, 3, 3) are which of others' (n, 3, 3), bit by bit.

    Returns
    -------
    same
        (n, 3, 3): of the first triangles, of the others.
    """
    x, y, z = (one_mm[:, :, None, k] == other_mm[:, None, :, k] for k in range(3))
    return np.asarray(x & y & z)


class Stitches:
    """A solid whose patches are replaced one by one; patches share no face.

    Parameters
    ----------
    vertices_mm, faces
        (V, 3) float64 and (F, 3), the solid before.
    """

    def __init__(self, vertices_mm: Floats, faces: Faces) -> None:
        self._vertices_mm = vertices_mm
        self._faces = faces
        self._kept = np.ones(len(faces), np.bool_)
        self._made: list[tuple[Floats, NDArray[np.int64], Any, Any]] = []
        self._count = len(vertices_mm)

    def put(self, closed: ClosedPatch, carved: Carved) -> None:
        """Replace a patch.

        Parameters
        ----------
        closed
            The patch, closed off.
        carved
            What it was carved into; `source_face` counts in `closed.faces`.

        Raises
        ------
        StitchError
            When its rim isn't the patch's any more.
        """
        stays = carved.source_face < len(closed.patch)  # not the fill
        faces, source = carved.faces[stays], carved.source_face[stays]
        skin = source >= 0
        number = np.full(len(carved.vertices_mm), -1, np.int64)
        before = closed.faces[source[skin]]
        same = same_corners(carved.vertices_mm[faces[skin]], closed.vertices_mm[before])
        face, corner, old = np.nonzero(same)
        number[faces[skin][face, corner]] = closed.corners[before[face, old]]
        new = np.zeros(len(number), np.bool_)
        new[faces] = True
        new &= number < 0
        number[new] = self._count + np.arange(int(new.sum()))
        put = number[faces]
        if not is_closed(np.concatenate([put, self._faces[closed.patch][:, ::-1]])):
            raise StitchError("a carved patch has another rim")
        self._count += int(new.sum())
        self._kept[closed.patch] = False
        origin = np.where(skin, closed.patch[np.where(skin, source, 0)], -1)
        self._made.append((carved.vertices_mm[new], put, carved.instance[stays], origin))

    def sewn(self) -> Carved:
        """Return the solid with its new patches, without the vertices that nothing uses."""
        vertices = np.concatenate([self._vertices_mm, *(made[0] for made in self._made)])
        kept = np.flatnonzero(self._kept)
        faces = np.concatenate([self._faces[kept], *(made[1] for made in self._made)])
        used = np.zeros(len(vertices), np.bool_)
        used[faces] = True
        number = np.cumsum(used, dtype=np.int32) - np.int32(1)
        instance = [np.zeros(len(kept), np.uint16), *(made[2] for made in self._made)]
        source = [kept, *(made[3] for made in self._made)]
        return Carved(
            vertices_mm=vertices[used],
            faces=number[faces],
            instance=np.concatenate(instance),
            source_face=np.concatenate(source).astype(np.int32),
        )
