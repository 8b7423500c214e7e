"""Reading triangles from STL, OBJ, PLY and 3MF files, as they stand."""

from __future__ import annotations

import os
import warnings
import zipfile
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from files.budget import allow, check_archive
from files.errors import RecipeError
from pipeline.parts.part_error import PartError

SUFFIXES: Final[tuple[str, ...]] = (".stl", ".obj", ".ply", ".3mf")
_OWN_UNITS = {
    "micron": "um",
    "microns": "um",
    "millimeter": "mm",
    "millimeters": "mm",
    "mm": "mm",
    "centimeter": "cm",
    "centimeters": "cm",
    "meter": "m",
    "meters": "m",
    "inch": "inch",
    "inches": "inch",
}


def read_mesh(
    source: str,
) -> tuple[NDArray[np.float64], NDArray[np.int64], str | None]:
    """Vertices, faces and own unit (3MF) of a mesh file; nothing welded, nothing scaled.

    Returns
    -------
    tuple
        (V, 3) vertices in the file's unit, (F, 3) vertex numbers, and the unit that the file
        itself declares, if it does.

    Raises
    ------
    PartError
        When the file is missing, empty, damaged, of another format or holds no triangles.
    """
    suffix = os.path.splitext(source)[1].lower()
    if suffix not in SUFFIXES:
        raise PartError(
            source, f"not a mesh format known here ({suffix or 'no suffix'})", "save it as STL"
        )
    if not os.path.exists(source):
        raise PartError(source, "no such file", "correct the path")
    if not os.path.isfile(source):
        raise PartError(source, "not a file", "name a mesh file, or a glob of them")
    if os.path.getsize(source) == 0:
        raise PartError(source, "the file is empty (0 bytes)", "export it again")
    try:
        _check_budget(source, suffix)
        vertices, faces, unit = _triangles(source, suffix[1:])
    except PartError:
        raise
    except Exception as error:
        # trimesh raises whatever its parsers stumble over: IndexError, struct.error, KeyError ...
        # only the loader's message on the file itself helps the user
        told = isinstance(error, OSError | ValueError) and str(error)
        reason = f" ({str(error).splitlines()[0][:120]})" if told else ""
        raise PartError(
            source, f"not a readable {suffix[1:].upper()} file{reason}", "export it again"
        ) from error
    if len(faces) == 0:
        if suffix == ".stl":
            _refuse_torn_stl(source)
        what = f"a cloud of {len(vertices)} points without faces" if len(vertices) else "no faces"
        mend = "mesh it first" if len(vertices) else "export it again with its solid"
        raise PartError(source, f"empty: {what}", mend)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise PartError(source, "faces name vertices that don't exist", "export it again")
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise PartError(
            source,
            f"{int(bad.sum())} of {len(vertices)} vertices are NaN or infinite "
            f"(first: vertex {int(np.argmax(bad))})",
            "repair the export",
        )
    return vertices, faces, unit


def _check_budget(source: str, suffix: str) -> None:
    """Refuse what would take more memory than a mesh may, before it is read."""
    try:
        allow("bytes", os.path.getsize(source), where=source)
        if suffix == ".3mf":
            with zipfile.ZipFile(source) as archive:
                check_archive(archive, source)
        if suffix == ".stl":
            allow("triangles", os.path.getsize(source) / 50, where=source)
    except RecipeError as error:
        raise PartError(source, str(error), "a coarser mesh, or a higher limit") from None


def _refuse_torn_stl(source: str) -> None:
    """Say so where a binary STL's length doesn't fit the number of facets in its header."""
    size = os.path.getsize(source)
    with open(source, "rb") as file:
        head = file.read(84)
    if len(head) < 84 or head[:5] == b"solid":
        return
    stated, held = int.from_bytes(head[80:84], "little"), (size - 84) / 50.0
    if stated != held:
        raise PartError(
            source,
            f"damaged: its header says {stated} facets, the file holds {held:g}",
            "copy or export it again",
        )


def _triangles(
    source: str, kind: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], str | None]:
    """Everything that trimesh finds in the file, its placed copies in one list of triangles."""
    import trimesh

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        options: dict[str, Any] = {"process": False}
        if kind in ("obj", "ply"):
            options["skip_materials"] = True
        # From an open file, so that nothing beside it (textures, materials) is looked for.
        with open(source, "rb") as file:
            scene = trimesh.load_scene(file, file_type=kind, **options)
        blocks: list[NDArray[np.float64]] = []
        corners: list[NDArray[np.int64]] = []
        count = 0
        for node in sorted(scene.graph.nodes_geometry):
            transform, key = scene.graph[node]
            geometry = scene.geometry[key]
            vertices = np.asarray(getattr(geometry, "vertices", np.empty((0, 3))), dtype=float)
            faces = np.asarray(getattr(geometry, "faces", np.empty((0, 3))), dtype=np.int64)
            if not np.array_equal(transform, np.eye(4)):
                vertices = vertices @ transform[:3, :3].T + transform[:3, 3]
                if np.linalg.det(transform[:3, :3]) < 0:
                    faces = faces[:, ::-1]
            blocks.append(vertices.reshape(-1, 3))
            corners.append(faces.reshape(-1, 3) + count)
            count += len(blocks[-1])
        unit = None
        if kind == "3mf":
            stated = {getattr(mesh, "units", None) for mesh in scene.geometry.values()}
            unit = next((_OWN_UNITS[u] for u in sorted(map(str, stated)) if u in _OWN_UNITS), None)
    if not blocks:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), unit
    return np.concatenate(blocks), np.concatenate(corners), unit
