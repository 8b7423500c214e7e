"""The surface that a flaw follows: nearest points, smooth normals, random points, walks on it."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from defects.surface.geodesic import CREASE_RAD, Skin, blend_normals, drop, walk
from defects.surface.nearest_point import build_tree

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class SiteError(ValueError):
    """The flaw does not fit the site: it would cross an edge of the part, fold, or meet a wall."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Site:
    """Position and heading of a flaw.

    Parameters
    ----------
    position_mm
        (3,) on the surface, part frame.
    normal
        (3,) outward smooth unit normal there.
    heading_rad
        Direction in the tangent plane, from the first axis of `tangent_axes(normal)`.
    triangle
        The face it lies on.
    """

    position_mm: Floats
    normal: Floats
    heading_rad: float
    triangle: int

    def direction(self, angle_rad: float = 0.0) -> Floats:
        """Return the unit tangent (3,) at `angle_rad` from the heading, about the normal."""
        return np.asarray(self.directions(np.array([angle_rad]))[0])

    def directions(self, angles_rad: Floats) -> Floats:
        """Return the unit tangents (k, 3) at angles (k,) from the heading, about the normal."""
        first, second = tangent_axes(self.normal)
        angles = (self.heading_rad + angles_rad)[:, None]
        return np.asarray(np.cos(angles) * first + np.sin(angles) * second)


@dataclass(frozen=True, kw_only=True, slots=True)
class Walk:
    """Points reached by walking on the surface, k walks of n steps.

    Parameters
    ----------
    points_mm, normals, directions
        (k, n, 3): where each step ends, the smooth normal there, the direction of travel there.
    triangles
        (k, n).
    complete
        (k,): False where an edge of the part stopped the walk.
    """

    points_mm: Floats
    normals: Floats
    directions: Floats
    triangles: Ints
    complete: NDArray[np.bool_]


def tangent_axes(normal: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors that make a right-handed frame with the unit `normal` (3,)."""
    away = np.zeros(3)
    away[int(np.argmin(np.abs(normal)))] = 1.0
    first = np.cross(normal, away)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Surface:
    """A part's skin, on which flaws are placed and bent; build by `Surface.of`.

    Parameters
    ----------
    vertices_mm, faces
        (V, 3) float64 and (F, 3) int32, part frame, closed, wound outwards.
    normals
        (F, 3) outward unit normals of the facets.
    area_mm2
        (F,).
    corner_normals
        (F, 3, 3) blended normals of each facet's corners.
    order, box, node
        The tree of boxes of `defects.surface.nearest_point`.
    """

    vertices_mm: Floats
    faces: Ints
    normals: Floats
    area_mm2: Floats
    corner_normals: Floats
    order: Ints
    box: Floats
    node: Ints

    @classmethod
    def of(cls, vertices_mm: Floats, faces: Ints) -> Self:
        """Prepare the surface of a closed mesh.

        Raises
        ------
        ValueError
            When the arrays aren't a triangle mesh.
        """
        vertices = np.array(vertices_mm, dtype=np.float64, order="C")  # writable: one compilation
        triangles = np.array(faces, dtype=np.int32, order="C")
        if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.shape[1:] != (3,):
            raise ValueError("a surface needs vertices (V, 3) and faces (F, 3)")
        if not len(triangles):
            raise ValueError("a surface needs at least one face")
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        cross = np.cross(b - a, c - a)
        length = np.linalg.norm(cross, axis=1)
        unit = cross / np.where(length > 0, length, 1.0)[:, None]
        corner = np.argsort(triangles.ravel(), kind="stable").astype(np.int32)
        counts = np.bincount(triangles.ravel(), minlength=len(vertices))
        start = np.concatenate(([0], np.cumsum(counts))).astype(np.int32)
        area = 0.5 * length
        blended = blend_normals(vertices, triangles, unit, area, start, corner)
        order, box, node = build_tree(vertices, triangles)
        return cls(
            vertices_mm=vertices,
            faces=triangles,
            normals=unit,
            area_mm2=area,
            corner_normals=blended,
            order=order,
            box=box,
            node=node,
        )

    @property
    def _skin(self) -> Skin:
        return Skin(
            self.vertices_mm, self.faces, self.corner_normals, self.order, self.box, self.node
        )

    def project(self, points_mm: Floats) -> tuple[Floats, Floats, Ints]:
        """Project points onto the surface.

        Parameters
        ----------
        points_mm
            (k, 3).

        Returns
        -------
        points_mm, normals, triangles
            (k, 3) on the mesh, (k, 3) smooth unit normals there, (k,) faces.
        """
        points = np.ascontiguousarray(points_mm, np.float64)
        onto, normals, triangles = drop(points, self._skin)
        return onto, normals, triangles

    def random_sites(
        self, rng: np.random.Generator, count: int, weight: Floats | None = None
    ) -> list[Site]:
        """Draw places uniformly by area, heading included.

        Parameters
        ----------
        rng
            Source of randomness.
        count
            How many.
        weight
            (F,) factor on each face's density: a mask, or shares; None: all alike.

        Raises
        ------
        SiteError
            When no face is left.
        """
        share = self.area_mm2 if weight is None else self.area_mm2 * weight
        total = np.cumsum(share)
        if not total[-1] > 0:
            raise SiteError("no face is left to place flaws on")
        at = np.searchsorted(total, rng.uniform(0.0, total[-1], count), side="right")
        faces = np.minimum(at, len(share) - 1)
        u, v = rng.uniform(size=(2, count))
        heading = rng.uniform(0.0, 2 * np.pi, count)
        root = np.sqrt(u)
        corner = np.stack([1 - root, root * (1 - v), root * v], axis=1)
        points = np.einsum("kc,kcx->kx", corner, self.vertices_mm[self.faces[faces]])
        normals = np.einsum("kc,kcx->kx", corner, self.corner_normals[faces])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return [
            Site(
                position_mm=points[i],
                normal=normals[i],
                heading_rad=float(heading[i]),
                triangle=int(faces[i]),
            )
            for i in range(count)
        ]

    def walk(
        self,
        start_mm: Floats,
        directions: Floats,
        steps_mm: Floats,
        turns_rad: Floats | None = None,
        max_step_mm: float = 0.25,
    ) -> Walk:
        """Walk on the surface, straight on or turning.

        Parameters
        ----------
        start_mm
            (k, 3) near the surface.
        directions
            (k, 3) first directions; their part along the normal is taken out.
        steps_mm
            (k, n) lengths of the steps.
        turns_rad
            (k, n) turn to the left (about the normal) before each step; None: straight.
        max_step_mm
            Longer steps are divided, so that the path stays on curved parts.
        """
        start, normals, triangles = self.project(start_mm)
        along = directions - np.sum(directions * normals, axis=1, keepdims=True) * normals
        # On an edge of the part the nearest face may be one that the direction stands on.
        length = np.linalg.norm(along, axis=1)
        along = along / np.where(length > 0, length, 1.0)[:, None]
        steps = np.ascontiguousarray(steps_mm, np.float64)
        turns = np.zeros_like(steps) if turns_rad is None else np.ascontiguousarray(turns_rad)
        points, normal, heading, triangle, complete = walk(
            start, normals, triangles, np.ascontiguousarray(along), steps, turns,
            float(max_step_mm), self._skin,
        )  # fmt: skip
        return Walk(
            points_mm=points,
            normals=normal,
            directions=heading,
            triangles=triangle,
            complete=complete & (length > 0),
        )

    def site_at(self, site: Site, distance_mm: float, rng: np.random.Generator) -> Site:
        """Walk from a site in a random direction and return where it ends, with a new heading.

        Raises
        ------
        SiteError
            When an edge of the part stops the walk.
        """
        angle, heading = rng.uniform(0.0, 2 * np.pi, 2)
        walk = self.walk(
            site.position_mm[None], site.direction(float(angle))[None], np.array([[distance_mm]])
        )
        if not walk.complete.all():
            raise SiteError("the flaw would cross an edge of the part")
        return Site(
            position_mm=walk.points_mm[0, 0],
            normal=walk.normals[0, 0],
            heading_rad=float(heading),
            triangle=int(walk.triangles[0, 0]),
        )

    def curvature_per_mm(
        self, site: Site, radius_mm: float, aspect: float = 1.0, whole: bool = False
    ) -> float:
        """Return the strongest curvature of the smooth normals around a site.

        Walks in 16 directions; edges of the part are excluded.

        Parameters
        ----------
        site
            Where, and the direction of the ellipse.
        radius_mm, aspect
            Half-axis of the ellipse along the heading, and the other over it.
        whole
            Whether the whole ellipse must be free of edges.

        Raises
        ------
        SiteError
            When it must be and isn't.
        """
        angles: Floats = np.arange(16.0) * (2 * np.pi / 16)
        start = np.repeat(site.position_mm[None], 16, axis=0)
        step = radius_mm / 12 / np.hypot(np.cos(angles), np.sin(angles) / aspect)[:, None]
        walk = self.walk(start, site.directions(angles), np.repeat(step, 12, axis=1))
        if whole and not walk.complete.all():
            raise SiteError("the flaw would cross an edge of the part")
        turn = np.linalg.norm(np.diff(walk.normals, axis=1), axis=2)
        moved = np.linalg.norm(np.diff(walk.points_mm, axis=1), axis=2)
        smooth = (moved > 0.5 * step) & (turn < 2 * np.sin(CREASE_RAD / 2))
        return float(np.where(smooth, turn / step, 0.0).max())
