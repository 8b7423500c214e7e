"""Bodies of a solid: which lie in which, which way they are wound, and uniting them."""

from __future__ import annotations

import manifold3d
import numpy as np
from numpy.typing import NDArray

from pipeline.parts.mesh import mending
from pipeline.parts.part_error import PartError

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]


def manifold(vertices_mm: Vertices, faces: NDArray[np.integer]) -> manifold3d.Manifold:
    """manifold3d's solid of a closed mesh, in double precision."""
    # Copies: Mesh64 takes no read-only arrays.
    return manifold3d.Manifold(
        manifold3d.Mesh64(
            np.array(vertices_mm, dtype=np.float64, order="C"),
            np.array(faces, dtype=np.uint64, order="C"),
        )
    )


def turn_outward(
    source: str, vertices: Vertices, faces: Faces, diagonal: float, notes: list[str]
) -> tuple[Vertices, Faces, bool]:
    """Turn bodies outward, keep cavities, drop bodies without volume; whether solids are nested."""
    body = mending.bodies(faces)
    centre = vertices.mean(axis=0)
    corners = vertices[faces] - centre
    parts = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volume = np.bincount(body, weights=parts)
    area = np.bincount(
        body,
        weights=np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        / 2.0,
    )
    flat = np.abs(volume) <= 1e-7 * diagonal * area
    if flat.all():
        raise PartError(
            source, "closed, but without volume (zero thickness)", "export its solid again"
        )
    if flat.any():
        notes.append(f"{int(flat.sum())} bodies without volume dropped")
        keep = ~flat[body]
        vertices, faces = mending.used(vertices, faces[keep])
        body = mending.bodies(faces)
        volume = volume[~flat]
    depth, inside = nesting(vertices, faces, body)
    way = np.where(volume > 0.0, 1, -1)
    # A body inside others keeps its way relative to the outermost ones: inward is a cavity.
    if (way[depth == 0] < 0).all():
        way = -way
    overlap = False
    for number in np.argsort(depth, kind="stable").tolist():
        solid_around = int(way[inside[number]].sum())
        if solid_around <= 0:
            way[number] = 1
        overlap |= solid_around > 0 and way[number] > 0
    wrong = way * volume < 0.0
    if wrong.any():
        turn = wrong[body]
        faces = faces.copy()
        faces[turn] = faces[turn][:, ::-1]
        outward = int((way[wrong] > 0).sum())
        notes.append(f"{int(wrong.sum())} bodies turned, {outward} of them outward")
    return vertices, faces, overlap


def nesting(
    vertices: Vertices, faces: Faces, body: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """How many other bodies each body lies in, and (k, k) which lies in which.

    A body lies in another when the winding number of the other about one of its vertices is not
    zero (van Oosterom and Strackee, 1983, solid angle of a triangle).
    """
    count = int(body.max()) + 1
    inside = np.zeros((count, count), dtype=np.bool_)
    if count == 1:
        return np.zeros(1, dtype=np.int64), inside
    order = np.argsort(body, kind="stable")
    rows = np.split(order, np.searchsorted(body[order], np.arange(1, count)))
    low = np.array([vertices[faces[row]].min(axis=(0, 1)) for row in rows])
    high = np.array([vertices[faces[row]].max(axis=(0, 1)) for row in rows])
    for one in range(count):
        point = vertices[faces[rows[one][0], 0]]
        around = (low[one] >= low).all(axis=1) & (high[one] <= high).all(axis=1)
        around[one] = False
        for other in np.flatnonzero(around).tolist():
            a, b, c = np.moveaxis(vertices[faces[rows[other]]] - point, 1, 0)
            la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
            above = np.einsum("ij,ij->i", a, np.cross(b, c))
            below = (
                la * lb * lc
                + np.einsum("ij,ij->i", a, b) * lc
                + np.einsum("ij,ij->i", b, c) * la
                + np.einsum("ij,ij->i", c, a) * lb
            )
            turns = np.arctan2(above, below).sum() / (2.0 * np.pi)
            inside[one, other] = abs(turns) > 0.75
    return inside.sum(axis=1), inside


def united(
    source: str,
    vertices: Vertices,
    faces: Faces,
    body: NDArray[np.int64],
    contact_mm: float,
    notes: list[str],
) -> tuple[Vertices, Faces]:
    """Unite bodies with manifold3d, in double precision; cavities stay with their bodies.

    Bodies that nearly coincide leave slivers: what is smaller than the contact tolerance is
    collapsed afterwards.
    """
    corners = vertices[faces] - vertices.mean(axis=0)
    parts = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volume = np.bincount(body, weights=parts)
    depth, inside = nesting(vertices, faces, body)
    owner = np.arange(len(volume))
    for cavity in np.flatnonzero(volume < 0.0):
        around = np.flatnonzero(inside[cavity] & (volume > 0.0))
        if len(around):
            owner[cavity] = around[np.argmax(depth[around])]
    solids = []
    for number in np.unique(owner):
        solid = manifold(*mending.used(vertices, faces[(owner == number)[body]]))
        if solid.status() != manifold3d.Error.NoError or solid.volume() <= 0.0:
            raise PartError(source, "bodies cross and can't be united", "unite them in CAD")
        solids.append(solid)
    whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    if whole.status() != manifold3d.Error.NoError or whole.is_empty():
        raise PartError(source, "bodies cross and can't be united", "unite them in CAD")
    clean = whole.simplify(contact_mm)
    near = abs(clean.volume() - whole.volume()) <= 10.0 * contact_mm * whole.surface_area()
    mesh = (clean if near else whole).to_mesh64()
    notes.append(f"{len(solids)} bodies that touch or overlap united")
    return (
        np.array(mesh.vert_properties[:, :3], dtype=np.float64),
        np.array(mesh.tri_verts, dtype=np.int64),
    )
