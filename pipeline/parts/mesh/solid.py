"""Making a closed solid of a mesh as it was read: what is mended, and what is refused."""

from __future__ import annotations

from typing import Final

import manifold3d
import numpy as np
from numpy.typing import NDArray

from pipeline.parts.mesh import mending
from pipeline.parts.mesh.bodies import manifold, turn_outward, united
from pipeline.parts.mesh.self_intersection import MOST_PAIRS, crossings
from pipeline.parts.mesh.thicken import thicken
from pipeline.parts.part_error import PartError

SMALLEST_MM: Final = 1e-3
LARGEST_MM: Final = 1e6
CONTACT: Final = 1e-6  # of the diagonal: rounding of single-precision files
HOLE_SHARE: Final = 0.05  # of the diagonal: the widest hole that is filled
HOLE_EDGES: Final = 100
MOST_HOLES: Final = 2000  # more are no holes, but faces that don't belong together

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]


def make_solid(
    source: str, vertices_mm: Vertices, faces: Faces, *, thicken_mm: float | None = None
) -> tuple[Vertices, Faces, tuple[str, ...]]:
    """Mend a mesh into closed bodies, outward, free of crossings; say what was mended.

    Returns
    -------
    tuple
        (V, 3) mm, (F, 3) and what was mended in plain words.

    Raises
    ------
    PartError
        When that isn't possible.
    """
    if thicken_mm is not None and not (np.isfinite(thicken_mm) and thicken_mm != 0.0):
        raise PartError(source, f"thicken_mm = {thicken_mm}", "a thickness other than zero")
    diagonal = _diagonal(source, vertices_mm, faces)
    notes: list[str] = []
    vertices, faces = _joined(vertices_mm, faces, diagonal, notes)
    if not len(faces):
        raise PartError(source, "no face has an area", "export it again with its solid")
    faces, turned, one_sided = mending.wind_alike(faces)
    if one_sided:
        raise PartError(source, "one-sided: faces can't be wound alike", "rebuild the surface")
    if turned:
        notes.append(f"{turned} faces turned to be wound like their neighbours")
    _, _, parted, left = mending.part_edges(vertices, faces)
    if left:
        _refuse_busy_edges(source, vertices, faces)
    vertices, faces, _, _ = mending.part_edges(vertices, faces)
    if parted:
        notes.append(f"{parted} edges shared by several bodies parted")
    faces = _filled(vertices, faces, diagonal, notes, slits_only=thicken_mm is not None)
    faces, needles = mending.flip_needles(vertices, faces, 1e-7 * diagonal)
    if needles:
        notes.append(f"{needles} faces without height merged into their neighbours")
    loops = _open_edges(faces)
    if len(loops):
        if thicken_mm is None:
            _refuse_open(source, vertices, faces, loops)
        vertices, faces = thicken(vertices, faces, thicken_mm or 0.0)
        notes.append(f"open sheet grown to a solid of {abs(thicken_mm or 0.0):g} mm")
    elif thicken_mm is not None:
        notes.append("already closed: thicken_mm not applied")
    vertices, faces, overlap = turn_outward(source, vertices, faces, diagonal, notes)
    vertices, faces = _uncrossed(
        source, vertices, faces, diagonal, notes, overlap or parted > 0, len(loops) > 0
    )
    status = manifold(vertices, faces).status()
    if status != manifold3d.Error.NoError:
        raise PartError(source, f"not a closed solid ({status.name})", "repair it in CAD")
    return vertices, faces, tuple(notes)


def _diagonal(source: str, vertices_mm: Vertices, faces: Faces) -> float:
    points, _ = mending.used(vertices_mm, faces)
    size = points.max(axis=0) - points.min(axis=0)
    if np.abs(points).max() > LARGEST_MM:
        raise PartError(
            source,
            f"coordinates up to {np.abs(points).max():.3g} mm, beyond {LARGEST_MM:g} mm",
            "give its unit, or repair the coordinates",
        )
    if size.max() < SMALLEST_MM:
        raise PartError(source, f"only {size.max():.3g} mm large", "give its unit (unit: m ...)")
    return float(np.linalg.norm(size))


def _joined(
    vertices_mm: Vertices, faces: Faces, diagonal: float, notes: list[str]
) -> tuple[Vertices, Faces]:
    """Weld equal and nearly equal vertices, drop faces that collapse or stand twice."""
    vertices, faces = mending.weld(vertices_mm, faces)
    faces, collapsed = mending.drop_collapsed(faces)
    for tolerance in (1e-7 * diagonal, CONTACT * diagonal, 1e-5 * diagonal):
        if not len(faces) or not len(_open_edges(faces)):
            break
        trial, trial_faces, joined = mending.weld_close(vertices, faces, tolerance)
        trial_faces, lost = mending.drop_collapsed(trial_faces)
        if joined and len(_open_edges(trial_faces)) < len(_open_edges(faces)):
            vertices, faces, collapsed = trial, trial_faces, collapsed + lost
            notes.append(f"{joined} vertices closer than {tolerance:.2g} mm joined")
    if collapsed:
        notes.append(f"{collapsed} faces without area dropped")
    faces, doubled = mending.drop_doubled(faces)
    if doubled:
        notes.append(f"{doubled} doubled faces dropped")
    return vertices, faces


def _open_edges(faces: Faces) -> NDArray[np.int64]:
    """(k, 2) edges that have one face only."""
    directed, edge = mending.halfedges(faces)
    return directed[np.bincount(edge)[edge] == 1] if len(edge) else directed


def _refuse_busy_edges(source: str, vertices: Vertices, faces: Faces) -> None:
    directed, edge = mending.halfedges(faces)
    busy = np.bincount(edge)[edge] > 2
    if busy.any():
        raise PartError(
            source,
            f"{len(np.unique(edge[busy]))} edges shared by more than two faces, first at "
            f"{_place(vertices[directed[np.argmax(busy)]].mean(axis=0))}",
            "export each body by itself, or unite them in CAD",
        )


def _filled(
    vertices: Vertices, faces: Faces, diagonal: float, notes: list[str], *, slits_only: bool
) -> Faces:
    """Close slits without area, and fill holes up to HOLE_SHARE of the diagonal wide."""
    filled: list[Faces] = []
    slits, widest = 0, 0.0
    loops = mending.open_loops(faces)
    if len(loops) > MOST_HOLES:
        return faces
    for loop in loops:
        if len(loop) > HOLE_EDGES:
            continue
        points = vertices[loop]
        width = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
        cover = mending.fill_loop(points)
        one, two, three = np.moveaxis(points[cover], 1, 0)
        area = float(np.linalg.norm(np.cross(two - one, three - one), axis=1).sum()) / 2.0
        if area <= CONTACT * diagonal * width:
            slits += 1
        elif not slits_only and width <= HOLE_SHARE * diagonal:
            widest = max(widest, width)
        else:
            continue
        filled.append(loop[cover])
    if slits:
        notes.append(f"{slits} slits between faces closed")
    if len(filled) > slits:
        notes.append(f"{len(filled) - slits} small holes filled, up to {widest:.3g} mm wide")
    return np.concatenate([faces, *filled])


def _refuse_open(source: str, vertices: Vertices, faces: Faces, rim: NDArray[np.int64]) -> None:
    loops = mending.open_loops(faces)
    at = vertices[np.unique(rim)]
    size = float(np.linalg.norm(np.ptp(mending.used(vertices, faces)[0], axis=0)))
    thick = float(f"{max(size * 0.005, 1e-4):.1g}")
    raise PartError(
        source,
        f"not closed: {len(rim)} open edges in {len(loops)} holes, between "
        f"{_place(at.min(axis=0))} and {_place(at.max(axis=0))}",
        f"thicken_mm: {thick:g} where it is a sheet's skin, else close it in CAD",
    )


def _uncrossed(
    source: str,
    vertices: Vertices,
    faces: Faces,
    diagonal: float,
    notes: list[str],
    touching: bool,
    thickened: bool,
) -> tuple[Vertices, Faces]:
    """Unite bodies that cross or share edges; refuse a body that crosses itself."""
    found = crossings(vertices, faces, tolerance_mm=CONTACT * diagonal)
    if found.over_budget and not len(found.pairs):
        notes.append("too large to be checked for self-intersection everywhere")
    body = mending.bodies(faces)
    own = body[found.pairs[:, 0]] == body[found.pairs[:, 1]]
    if own.any():
        raise PartError(
            source,
            f"self-intersection: {'' if found.complete else 'at least '}{int(own.sum())} pairs of "
            f"faces cross, first at {_place(found.points_mm[np.argmax(own)])}",
            "a smaller thicken_mm, or a negative one (the other side)"
            if thickened
            else "rebuild or unite it in CAD",
        )
    if found.over_budget and len(found.pairs):
        raise PartError(
            source,
            f"bodies nearly coincide: over {MOST_PAIRS / 1e6:.0f} million pairs of faces may cross,"
            f" first at {_place(found.points_mm[0])}",
            "leave one of them out, or unite them in CAD",
        )
    count = int(body.max()) + 1
    if count == 1 or not (touching or len(found.pairs)):
        return vertices, faces
    return united(source, vertices, faces, body, CONTACT * diagonal, notes)


def _place(point: Vertices) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point) + ") mm"
