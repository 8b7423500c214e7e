"""Nominal shape of a real recording whose CAD nobody publishes: what its maker would have drawn.

The recording's highest faces are taken for planes, or for spheres where they are none, bounded by
straight lines. What stands on a face is sought in the same way. Nothing finer than `STEP_MM` and
nothing that bends or ripples within a face enters the shape: that is left for the diagnosis.
"""

from dataclasses import dataclass

import contourpy
import numpy as np
import trimesh
from manifold3d import CrossSection, FillRule, Manifold
from numpy.typing import NDArray
from scipy import ndimage

from sensors.recording import Recording

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP_MM = 1.0
"""Least height of what stands on a face."""
LEAST_PIXELS = 150
FLAT_MM, FLAT_SHARE = 0.35, 0.4
"""A face is a plane where this share of its readings lies that near."""
STRAIGHT_MM = 0.25
"""Outlines keep to the readings' border as near as that."""
DEEP_MM = 10.0


@dataclass(frozen=True, kw_only=True)
class Map:
    """Positions (n, m) of the readings in the part's frame, mm; z is NaN where missing."""

    x: Floats
    y: Floats
    z: Floats

    @classmethod
    def of(cls, recording: Recording) -> "Map":
        """Take a scan along y that looks straight down."""
        assert recording.x_mm is not None
        shape = recording.depth_mm.shape
        return cls(
            x=np.broadcast_to(recording.x_mm, shape),
            y=np.broadcast_to(recording.poses[:, 1, 3][:, None], shape),
            z=recording.poses[:, 2, 3][:, None] - recording.depth_mm,
        )

    def above(self, plane: Floats) -> Floats:
        """Height (n, m) over a plane z = a x + b y + c."""
        return self.z - (plane[0] * self.x + plane[1] * self.y + plane[2])


def plane_of(here: Map, mask: Mask) -> Floats:
    """Plane (a, b, c) through most of the readings of a mask, begun at their commonest height."""
    x, y, z = here.x[mask], here.y[mask], here.z[mask]
    design = np.stack([x, y, np.ones(z.size)], axis=1)
    counts, ends = np.histogram(z, bins=60)
    start = ends[np.argmax(counts)]
    # a ramp has no commonest height: all of it serves as a start, too
    starts = [np.abs(z - start) < max(0.05 * np.ptp(z), FLAT_MM), np.ones(z.size, dtype=bool)]
    best, most = np.zeros(3), -1
    for near in starts:
        for _ in range(15):
            plane = np.linalg.lstsq(design[near], z[near], rcond=None)[0]
            away = np.abs(z - design @ plane)
            near = away < max(FLAT_MM, 2 * float(np.median(away[near])))
        close = int((away < FLAT_MM).sum())
        if close > most:
            best, most = plane, close
    return best


def sphere_of(here: Map, mask: Mask) -> tuple[Floats, float]:
    """Centre (3,) and radius of a sphere through the readings of a mask, outliers left out."""
    points = np.stack([here.x[mask], here.y[mask], here.z[mask]], axis=1)
    near = np.ones(len(points), dtype=bool)
    for _ in range(6):
        design = np.column_stack([2 * points[near], np.ones(near.sum())])
        solved = np.linalg.lstsq(design, (points[near] ** 2).sum(axis=1), rcond=None)[0]
        centre, radius = solved[:3], float(np.sqrt(solved[3] + solved[:3] @ solved[:3]))
        away = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
        near = away < 3 * max(1.4826 * float(np.median(away)), 0.05)
    return centre, radius


def outline(here: Map, mask: Mask) -> CrossSection:
    """Area of a mask in the x-y plane, its border of straight lines."""
    wide = np.pad(mask.astype(np.float64), 1)
    lines = contourpy.contour_generator(z=wide).lines(0.5)
    x, y = here.x[0], here.y[:, 0]
    loops = [
        np.column_stack(
            [
                np.interp(line[:, 0] - 1, np.arange(x.size), x),
                np.interp(line[:, 1] - 1, np.arange(y.size), y),
            ]
        )[:-1]
        for line in lines
        if len(line) > 8
    ]
    return CrossSection(loops, FillRule.EvenOdd).simplify(STRAIGHT_MM)


def pillar(area: CrossSection, plane: Floats, deep_mm: float) -> Manifold:
    """Solid below a plane and above another, `deep_mm` lower, within an area."""
    normal = np.array([plane[0], plane[1], -1.0])
    size = float(np.linalg.norm(normal))
    low, high = plane[2] - 200.0, plane[2] + 200.0
    solid = area.extrude(high - low).translate((0.0, 0.0, low))
    return _over(solid.trim_by_plane(tuple(normal / size), -plane[2] / size), plane, deep_mm)


def _over(solid: Manifold, plane: Floats, deep_mm: float) -> Manifold:
    """Return what of a solid lies above a plane, that one lowered by `deep_mm`."""
    normal = np.array([-plane[0], -plane[1], 1.0])
    size = float(np.linalg.norm(normal))
    return solid.trim_by_plane(tuple(normal / size), (plane[2] - deep_mm) / size)


def standing(here: Map, plane: Floats, within: Mask) -> tuple[list[Manifold], list[Manifold]]:
    """Solids that stand on a plane, and holes that go through it."""
    height = here.above(plane)
    labels, count = ndimage.label(ndimage.binary_opening(within & (height > STEP_MM)))
    solids: list[Manifold] = []
    holes: list[Manifold] = []
    for k in range(1, count + 1):
        mask = labels == k
        if mask.sum() < LEAST_PIXELS:
            continue
        top = plane_of(here, mask)
        over = here.above(top)
        if (np.abs(over[mask]) < FLAT_MM).mean() < FLAT_SHARE:
            centre, radius = sphere_of(here, mask)
            ball = Manifold.sphere(radius, 180).translate(tuple(centre))
            solids.append(_over(ball, plane, 0.5))
            continue
        face = mask & (over > -STEP_MM)
        # a ramp goes on below the step
        runs_on = within & (np.abs(over) < FLAT_MM / 2) & (height > 0)
        face = ndimage.binary_propagation(face, mask=face | runs_on)
        upon, through = standing(here, top, mask)
        if upon:
            # what stands on a face hides some of it
            face = ndimage.binary_fill_holes(face)
        area = outline(here, face)
        solids += [pillar(area, top, DEEP_MM), *upon]
        holes += through
        for hole in _holes(face):
            depth = height[hole]
            if not np.isfinite(depth).any() or np.nanmedian(depth) < -STEP_MM:
                holes.append(pillar(outline(here, hole), top + [0, 0, 1.0], 3 * DEEP_MM))
    return solids, holes


def _holes(face: Mask) -> list[Mask]:
    labels, count = ndimage.label(ndimage.binary_fill_holes(face) & ~face)
    every = (labels == k for k in range(1, count + 1))
    return [hole for hole in every if hole.sum() >= LEAST_PIXELS]


def nominal(
    recording: Recording, floor_mm: tuple[float, float], *, table: bool
) -> trimesh.Trimesh:
    """Build the solid.

    Parameters
    ----------
    floor_mm : heights in the part's frame between which the lowest face lies
    table : whether the lowest face goes on where nothing is read
    """
    here = Map.of(recording)
    known = np.isfinite(here.z)
    floor = plane_of(here, known & (here.z > floor_mm[0]) & (here.z < floor_mm[1]))
    solids, holes = standing(here, floor, known)
    if table:
        ends = _around(here, 2.0)
    else:
        ends = outline(here, ndimage.binary_opening(known, iterations=3)).hull()
    whole = sum(solids, Manifold())
    for hole in holes:
        whole -= hole
    return _mesh(whole + pillar(ends, floor, DEEP_MM))


def plate(recording: Recording) -> trimesh.Trimesh:
    """Build a plate whose top is the plane of most of the readings."""
    here = Map.of(recording)
    top = plane_of(here, np.isfinite(here.z))
    return _mesh(pillar(_around(here, 1.0), top, DEEP_MM))


def _around(here: Map, margin_mm: float) -> CrossSection:
    """Rectangle around all places of a scan."""
    sides = np.ptp(here.x) + 2 * margin_mm, np.ptp(here.y) + 2 * margin_mm
    return CrossSection.square(sides).translate(
        (here.x.min() - margin_mm, here.y.min() - margin_mm)
    )


def _mesh(solid: Manifold) -> trimesh.Trimesh:
    mesh = solid.to_mesh()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)
