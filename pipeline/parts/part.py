"""A part: a closed solid of triangles in millimetres, built in or read from a mesh file."""

from __future__ import annotations

import glob
import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.mesh.meshfile import SUFFIXES, read_mesh
from pipeline.parts.part_error import PartError

LOG: Final = logging.getLogger("flawforge.part")
MANY: Final = 400_000  # triangles from which their check takes more than some ten seconds
UNITS_MM: Final[Mapping[str, float]] = {
    "mm": 1.0,
    "cm": 10.0,
    "m": 1000.0,
    "um": 1e-3,
    "inch": 25.4,
}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Part:
    """A closed solid: every edge has two faces, wound oppositely, outward normals.

    Attributes
    ----------
    name
        What recipes and manifests call it.
    vertices_mm
        (V, 3) float64, mm, part frame; read-only.
    faces
        (F, 3) int32, counter-clockwise seen from outside; read-only.
    regions
        Named face regions, each bool (F,); empty for parts read from files.
    mended
        What was mended on reading, in plain words, one entry each.
    source
        The path it was read from, or ``builtin:NAME``.
    """

    name: str
    vertices_mm: NDArray[np.float64]
    faces: NDArray[np.int32]
    regions: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    mended: tuple[str, ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices_mm, dtype=np.float64, order="C")
        faces = np.array(self.faces, dtype=np.int32, order="C")
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ValueError(f"vertices_mm has shape {vertices.shape}, allowed is (V, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(f"faces has shape {faces.shape}, allowed is (F, 3)")
        regions = {}
        for name, member in self.regions.items():
            mask = np.array(member, dtype=np.bool_)
            if mask.shape != (len(faces),):
                raise ValueError(f"region {name!r} has shape {mask.shape}, not ({len(faces)},)")
            mask.setflags(write=False)
            regions[name] = mask
        vertices.setflags(write=False)
        faces.setflags(write=False)
        object.__setattr__(self, "vertices_mm", vertices)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "regions", regions)

    @property
    def bounds_mm(self) -> NDArray[np.float64]:
        """(2, 3) lowest and highest corner, mm, part frame."""
        return np.stack([self.vertices_mm.min(axis=0), self.vertices_mm.max(axis=0)])

    @property
    def area_mm2(self) -> float:
        """Area of the whole skin, mm²."""
        corners = self.vertices_mm[self.faces]
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return float(np.linalg.norm(crossed, axis=1).sum() / 2.0)

    @property
    def volume_mm3(self) -> float:
        """Enclosed volume by the divergence theorem, mm³; positive for outward winding."""
        corners = self.vertices_mm[self.faces] - self.vertices_mm.mean(axis=0)
        crossed = np.cross(corners[:, 1], corners[:, 2])
        return float(np.einsum("ij,ij->", corners[:, 0], crossed) / 6.0)


def load_part(
    path: str | os.PathLike[str],
    *,
    unit: str = "mm",
    thicken_mm: float | None = None,
    name: str | None = None,
) -> Part:
    """Read a part from an STL, OBJ, PLY or 3MF file and mend what can be mended honestly.

    Parameters
    ----------
    path
        The mesh file; the part frame is the file's own.
    unit
        Unit of the file's coordinates: ``mm``, ``cm``, ``m``, ``um`` or ``inch``. A 3MF file
        says its own, which wins.
    thicken_mm
        For open sheet skins: thickness in mm by which the skin grows against its normals (with
        the normals where negative) into a thin closed solid. Not applied to closed meshes.
    name
        Name of the part; the file's stem by default.

    Raises
    ------
    PartError
        When the file can't be read or its mesh can't be made a closed solid.
    """
    from pipeline.parts.mesh.solid import make_solid

    source = os.fspath(path)
    if unit not in UNITS_MM:
        raise PartError(source, f"unknown unit {unit!r}", f"unit: one of {', '.join(UNITS_MM)}")
    vertices, faces, own_unit = read_mesh(source)
    notes: list[str] = []
    if own_unit is not None and own_unit != unit:
        notes.append(f"unit {own_unit} taken from the file")
        unit = own_unit
    if len(faces) >= MANY:
        LOG.warning("%s: checking %d triangles; this may take minutes", source, len(faces))
    vertices_mm, faces, mended = make_solid(
        source, vertices * UNITS_MM[unit], faces, thicken_mm=thicken_mm
    )
    return Part(
        name=name if name is not None else Path(source).stem,
        vertices_mm=vertices_mm,
        faces=faces.astype(np.int32),
        mended=(*notes, *mended),
        source=source,
    )


def find_parts(pattern: str | os.PathLike[str]) -> list[Path]:
    """Mesh files that a path or glob names, sorted by path, each once.

    A plain path is returned as it is, whether it exists or not, so that the reader can say what
    is wrong with it. A glob (``**`` allowed) gives the files of a known mesh format alone; a
    folder, those directly inside it.

    Raises
    ------
    PartError
        When a glob or a folder holds no mesh file.
    """
    text = os.fspath(pattern)
    if os.path.isdir(text):
        text = os.path.join(glob.escape(text), "*")
    elif not glob.has_magic(text) or os.path.exists(text):
        return [Path(text)]
    found = {
        Path(hit)
        for hit in glob.glob(text, recursive=True)
        if hit.lower().endswith(SUFFIXES) and os.path.isfile(hit)
    }
    if not found:
        raise PartError(
            pattern, "no mesh file matches", f"a path or glob of {', '.join(SUFFIXES)} files"
        )
    return sorted(found)
