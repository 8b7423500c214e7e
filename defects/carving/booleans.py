"""Booleans of closed solids in double precision; only this module uses manifold3d."""

from typing import Any

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray

from defects.carving.solid import VOLUME_TOLERANCE_MM, BooleanError, Solid
from defects.carving.stitch import Carved, is_closed

Floats = NDArray[np.float64]


def union(solids: tuple[Solid, ...]) -> Solid:
    """Return the union of solids that may overlap.

    Raises
    ------
    BooleanError
        When one isn't a closed solid.
    """
    if len(solids) == 1:
        return solids[0]
    return solid_of(add([manifold(solid, new_identity()) for solid in solids]))


def new_identity() -> int:
    """Return a number that identifies the faces of one mesh in the results of booleans."""
    return int(Manifold.reserve_ids(1))


def solid_of(body: Manifold) -> Solid:
    """Convert a solid of manifold3d to a `Solid`."""
    mesh = body.to_mesh64()
    return Solid(
        vertices_mm=np.array(mesh.vert_properties, np.float64)[:, :3],
        faces=np.array(mesh.tri_verts, np.int32),
    )


def add(manifolds: list[Manifold]) -> Manifold:
    """Return the union."""
    return checked(Manifold.batch_boolean(manifolds, OpType.Add), "union")


def checked(body: Manifold, what: str) -> Manifold:
    """Return the result after manifold3d's check."""
    if body.status() != Error.NoError:
        raise BooleanError(f"{what}: {body.status().name}")
    return body


def manifold(solid: Solid, identity: int) -> Manifold:
    """Return a closed solid as manifold3d's, its faces known by an identity."""
    body = mesh_manifold(solid.vertices_mm, solid.faces, identity)
    if body.volume() <= 0:
        raise BooleanError("mesh: its volume isn't positive")
    return body


def mesh_manifold(
    vertices_mm: Floats, faces: NDArray[np.integer[Any]], identity: int
) -> Manifold:
    """Return a closed mesh as manifold3d's, whatever the sign of its volume."""
    mesh = Mesh64(
        np.array(vertices_mm, dtype=np.float64, order="C"),  # manifold3d wants them writable
        np.array(faces, dtype=np.uint64, order="C"),
        run_index=np.array([0, 3 * len(faces)], np.uint64),
        run_original_id=np.array([identity], np.uint32),
        # A face of its own each: coplanar neighbours are never merged, so nothing moves.
        face_id=np.arange(len(faces), dtype=np.uint64),
    )
    return checked(Manifold(mesh), "mesh")


def _runs(mesh: Mesh64) -> NDArray[np.int64]:
    """Return the original id (F,) of each face."""
    index = np.array(mesh.run_index, np.int64) // 3
    return np.repeat(np.array(mesh.run_original_id, np.int64), np.diff(index))


def labelled(mesh: Mesh64, owner: dict[int, int]) -> Carved:
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


def faces_of(mesh: Mesh64, identity: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the faces (n,) that come from `identity`, and which of its own each is of."""
    rows = np.flatnonzero(_runs(mesh) == identity)
    return rows, np.array(mesh.face_id, np.int64)[rows]


def skin_of(body: Manifold, identity: int) -> tuple[Floats, Floats]:
    """Return centres and doubled area vectors (n, 3) of the faces that come from `identity`."""
    mesh = body.to_mesh64()
    faces = np.array(mesh.tri_verts, np.int64)[_runs(mesh) == identity]
    a, b, c = (np.array(mesh.vert_properties, np.float64)[faces[:, i], :3] for i in range(3))
    return (a + b + c) / 3, np.cross(b - a, c - a)


def area_mm2(cross: Floats) -> float:
    """Return the area of faces by their doubled area vectors (n, 3)."""
    return float(np.linalg.norm(cross, axis=1).sum() / 2)


def checked_mesh(result: Manifold, wanted_mm3: float) -> Mesh64:
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
