"""Real CAD meshes as parts: read from files that a set keeps, laid flat, scaled to the range."""

from pathlib import Path

import numpy as np
import trimesh

from challenge.cases.parts import LENGTH_MM
from challenge.instrument.instrument import Solid
from challenge.instrument.rays import plant
from challenge.second.edges import off_edges
from challenge.second.lit import cast

MARK = "mesh "
"""A case's shape that begins so is the name of a file among the set's meshes."""
KINDS = (".stl", ".ply", ".obj")
MOST_FACES = 200_000
HIGH_MM = 7.0
"""Height to which a mesh is scaled at most: the range is 12 mm, and the poses lean."""

FIELD_MM, PITCH_MM, LEAST_SMOOTH = (8.0, 6.0), 0.1, 0.4
"""Half the field that a scan sees, its pitch, and the share of it that must be off edges."""


def files(folder: Path) -> list[Path]:
    """Return the closed meshes of a folder whose middle has places off edges to measure.

    Raises
    ------
    ValueError
        Where the folder has none.
    """
    found = [p for p in sorted(folder.iterdir()) if p.suffix.lower() in KINDS and _fit(p)]
    if not found:
        raise ValueError(f"--meshes: no closed mesh in {folder}; allowed: {', '.join(KINDS)}")
    return found


def _fit(file: Path) -> bool:
    """Whether a mesh is closed, and seen from above its middle isn't all facets' edges."""
    if not _closed(file):
        return False
    solid = solid_of_file(file)
    below = solid.vertices_mm * [1.0, 1.0, -1.0] + [0.0, 0.0, 50.0]  # seen along +z
    x, y = (np.arange(-half, half, PITCH_MM) for half in FIELD_MM)
    depth, _ = cast(plant(below, solid.faces[:, ::-1]), x, y)
    return bool(off_edges(depth).mean() >= LEAST_SMOOTH)


def _closed(file: Path) -> bool:
    try:
        mesh = trimesh.load_mesh(file)
    except (ValueError, IndexError, OSError):
        return False
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) > MOST_FACES:
        return False
    return bool(mesh.is_watertight and mesh.volume > 0)


def solid_of_file(file: Path) -> Solid:
    """Lay a mesh on its widest side, its top at z = 0 at most `HIGH_MM` above its bottom.

    Raises
    ------
    ValueError
        Where the file is none, or its mesh isn't closed.
    """
    if not file.exists() or not _closed(file):
        raise ValueError(f"{file.name}: not a closed mesh")
    mesh = trimesh.load_mesh(file)
    vertices, extents = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.extents)
    order = np.argsort(extents)[::-1]  # longest along x, shortest up
    even = np.linalg.det(np.eye(3)[order]) > 0
    vertices = vertices[:, order] * (1.0 if even else np.array([1.0, -1.0, 1.0]))
    size = np.ptp(vertices, axis=0)
    vertices = vertices * min(LENGTH_MM / size[0], HIGH_MM / size[2])
    low, high = vertices.min(0), vertices.max(0)
    vertices = vertices - [*(low + high)[:2] / 2, high[2]]
    # what the STL's single precision holds is the truth for everybody
    vertices = vertices.astype(np.float32).astype(np.float64)
    return Solid(vertices_mm=vertices, faces=np.asarray(mesh.faces, np.int64))
