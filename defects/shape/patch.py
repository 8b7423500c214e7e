"""A patch of skin as a mesh, from which cutters are raised and sunk along the normal."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from defects.carving.booleans import union
from defects.carving.solid import Cutter, Solid
from defects.seats.feature_edges import Frames
from defects.shape.thinning import Grid, filled
from defects.surface.surface import Site, SiteError, Surface

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SPARED = 0.8
"""Of the sagitta: how far points that are left out may stand off. A smooth surface's own cells, of
half that side, stand off by a quarter of it: 5/4 of 0.8 is 1."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Patch:
    """Points of the skin with local normals, joined to a mesh that has one rim.

    Parameters
    ----------
    skin_mm, normals
        (n, 3): points on the part's surface and smooth unit normals.
    faces
        (m, 3), wound so that they face along the normals.
    first, second
        (n,) coordinates of each point in the patch: radius ratio and angle of a disk; position
        along and across of a strip, both in mm.
    grid
        The faces' rows and columns; None: the faces are a piece of a grid.
    """

    skin_mm: Floats
    normals: Floats
    faces: Ints
    first: Floats
    second: Floats
    grid: Grid | None = None

    @classmethod
    def disk(
        cls,
        surface: Surface,
        site: Site,
        outline_mm: Floats,
        rho: Floats,
    ) -> Self:
        """Spread a disk over the surface by walking outwards from a site.

        Parameters
        ----------
        surface, site
            Where.
        outline_mm
            (k,) length of the walk to radius ratio 1, for k headings evenly spaced from the
            site's own.
        rho
            (r,) rising radius ratios of the rings, above 0; some come in between.

        Raises
        ------
        SiteError
            When the disk crosses an edge of the part or folds.
        """
        rho = filled(rho, 1)
        k, r = len(outline_mm), len(rho)
        angles = np.arange(k) * (2 * np.pi / k)
        start = np.repeat(site.position_mm[None], k, axis=0)
        first, second = tangent_frame(site)
        directions = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
        steps = outline_mm[:, None] * np.diff(rho, prepend=0.0)
        walk = surface.walk(start, directions, steps)
        if not walk.complete.all():
            raise SiteError("the flaw would cross an edge of the part")
        skin = np.concatenate([site.position_mm[None], walk.points_mm.reshape(-1, 3)])
        normals = np.concatenate([site.normal[None], walk.normals.reshape(-1, 3)])
        grid = Grid(node=1 + np.arange(k * r, dtype=np.int32).reshape(k, r), hub=0)
        patch = cls(
            skin_mm=skin,
            normals=normals,
            faces=grid.faces,
            first=np.concatenate([[0.0], np.tile(rho, k)]),
            second=np.concatenate([[0.0], np.repeat(angles, r)]),
            grid=grid,
        )
        patch._check()
        return patch

    @classmethod
    def strip(
        cls, surface: Surface, path_mm: Floats, along: Floats, along_mm: Floats, across_mm: Floats
    ) -> Self:
        """Spread a strip to both sides of a path.

        Parameters
        ----------
        surface
            Where.
        path_mm, along
            (n, 3) points of the path and its directions there.
        along_mm
            (n,) position along the path.
        across_mm
            (h,) rising distances from the path, above 0, walked to the left and to the right.

        Raises
        ------
        SiteError
            When the strip crosses an edge of the part or folds.
        """
        onto, normals, _ = surface.project(path_mm)
        left = np.cross(normals, along)
        steps = np.repeat(np.diff(across_mm, prepend=0.0)[None], 2 * len(path_mm), axis=0)
        walk = surface.walk(np.concatenate([onto, onto]), np.concatenate([left, -left]), steps)
        if not walk.complete.all():
            raise SiteError("the flaw would cross an edge of the part")
        n = len(path_mm)

        def both(middle: Floats, sides: Floats) -> Floats:
            return np.concatenate([sides[n:, ::-1], middle[:, None], sides[:n]], axis=1)

        skin = both(onto, walk.points_mm)
        width = skin.shape[1]
        grid = Grid(node=np.arange(n * width, dtype=np.int32).reshape(n, width))
        across = np.concatenate([-across_mm[::-1], [0.0], across_mm])
        patch = cls(
            skin_mm=skin.reshape(-1, 3),
            normals=both(normals, walk.normals).reshape(-1, 3),
            faces=grid.faces,
            first=np.repeat(along_mm, width),
            second=np.tile(across, n),
            grid=grid,
        )
        patch._check()
        return patch

    @classmethod
    def along_edge(
        cls,
        frames: Frames,
        along_mm: Floats,
        across: Floats,
        reach_mm: tuple[float, float],
        lean_rad: float = 0.0,
    ) -> Self:
        """Spread a strip over a feature edge: down the faces to its left and to its right.

        Its normals are the bisectors of the two faces' normals, so that one height over the strip
        describes a surface that replaces the edge.

        Parameters
        ----------
        frames
            Of the edge at n stations.
        along_mm
            (n,) position of the stations.
        across
            (k,) rising positions across the edge, in reaches: -1 on the right face, 1 on the left.
        reach_mm
            Reach on the left and on the right face.
        lean_rad
            Angle by which the normals are turned from the bisector to the left.

        Raises
        ------
        SiteError
            When the strip folds.
        """
        left, right = (
            np.maximum(sign * across, 0.0)[None, :, None] * reach * away[:, None]
            for sign, reach, away in (
                (1, reach_mm[0], frames.left), (-1, reach_mm[1], frames.right)
            )  # fmt: skip
        )
        skin = frames.points_mm[:, None] + left + right
        sideways = np.cross(frames.outward, frames.along)
        normal = np.cos(lean_rad) * frames.outward + np.sin(lean_rad) * sideways
        n, k = skin.shape[:2]
        grid = Grid(node=np.arange(n * k, dtype=np.int32).reshape(n, k))
        patch = cls(
            skin_mm=skin.reshape(-1, 3),
            normals=np.repeat(normal, k, axis=0),
            faces=grid.faces,
            first=np.repeat(along_mm, k),
            second=np.tile(across, n),
            grid=grid,
        )
        patch._check()
        return patch

    def solid(
        self, low_mm: Floats, high_mm: Floats, *, loose_mm: tuple[float, float] = (0.0, 0.0)
    ) -> Solid:
        """Return the closed solid between two heights (n,) above the skin, `low` below `high`.

        `loose_mm` states how far the facets of the two sides may deviate where they are hidden.
        """
        sides = []
        for height, loose in zip((low_mm, high_mm), loose_mm, strict=True):
            faces = self.faces
            if self.grid is not None and loose > 0:
                faces = self.grid.thinned(self.at(height), loose)
            sides.append((self.at(height), faces))
        return self.closed(*sides)[0]

    def at(self, height_mm: Floats) -> Floats:
        """Return the places (n, 3) at heights over the skin."""
        return np.asarray(self.skin_mm + height_mm[:, None] * self.normals)

    def closed(self, low: tuple[Floats, Ints], high: tuple[Floats, Ints]) -> tuple[Solid, Ints]:
        """Join two sides, each with its places (n, 3) and faces, by walls at the rim.

        Returns
        -------
        Solid
            The lower side's faces come first, turned over, then the upper side's and the walls.
        number
            (2, n) the solid's vertex that each place of the two sides is; -1: none.
        """
        count = len(self.skin_mm)
        start, end = self._rim()
        rims = []
        for _, faces in (low, high):
            own = np.arange(count, dtype=np.int32)
            if self.grid is not None:
                own = self.grid.stand_ins(faces, count)
            rims.append((own[start], own[end]))
        (a, b), (c, d) = rims
        faces = np.concatenate(
            [
                low[1][:, ::-1],
                high[1] + count,
                np.stack([a, b, d + count], 1)[a != b],
                np.stack([a, d + count, c + count], 1)[c != d],
            ]
        )
        used = np.zeros(2 * count, np.bool_)
        used[faces] = True
        number = np.where(used, np.cumsum(used, dtype=np.int32) - np.int32(1), np.int32(-1))
        places = np.concatenate([low[0], high[0]])[used]
        return Solid(vertices_mm=places, faces=number[faces]), number.reshape(2, count)

    def _rim(self) -> tuple[Ints, Ints]:
        """Return the edges that one face alone has: their starts and their ends (n,)."""
        if self.grid is not None:
            return self.grid.rim, np.roll(self.grid.rim, -1)
        edges = np.concatenate([self.faces[:, [k, (k + 1) % 3]] for k in range(3)])
        there = edges.astype(np.int64) @ np.array([len(self.skin_mm), 1])
        back = edges[:, ::-1].astype(np.int64) @ np.array([len(self.skin_mm), 1])
        rim = edges[~np.isin(there, back)]
        return rim[:, 0], rim[:, 1]

    def _used(self) -> NDArray[np.intp]:
        """Return the numbers of the points that faces meet in; `np.unique` takes far longer."""
        meets = np.zeros(len(self.skin_mm), np.bool_)
        meets[self.faces] = True
        return np.flatnonzero(meets)

    def part(self, keep: NDArray[np.bool_]) -> "Patch":
        """Return the patch of the faces whose corners are all kept; `keep` is (n,)."""
        return Patch(
            skin_mm=self.skin_mm,
            normals=self.normals,
            faces=self.faces[keep[self.faces].all(axis=1)],
            first=self.first,
            second=self.second,
        )

    def cells(self, keep: NDArray[np.bool_]) -> "Patch":
        """Return the patch of some cells of a strip; `keep` is (n - 1, k - 1) along and across."""
        return Patch(
            skin_mm=self.skin_mm,
            normals=self.normals,
            faces=self.faces[np.tile(keep.ravel(), 2)],
            first=self.first,
            second=self.second,
        )

    def _check(self) -> None:
        a, b, c = (self.skin_mm.take(self.faces[:, i], axis=0) for i in range(3))
        cross = np.cross(b - a, c - a)
        one, other, third = (self.normals.take(self.faces[:, i], axis=0) for i in range(3))
        mean = one + other + third
        size = np.linalg.norm(cross, axis=1) * np.linalg.norm(mean, axis=1)
        if not (np.einsum("ij,ij->i", cross, mean) > 0.2 * size).all():
            raise SiteError("the surface bends too strongly for a flaw of this size")


def tangent_frame(site: Site) -> tuple[Floats, Floats]:
    """Return the site's heading and the direction to the left of it, unit vectors (3,)."""
    return site.direction(), site.direction(np.pi / 2)


def dig(
    patch: Patch,
    height_mm: Floats,
    under: NDArray[np.bool_],
    depth_mm: float,
    sagitta_mm: float = 0.0,
) -> Cutter:
    """Take away what lies above a wanted surface.

    Parameters
    ----------
    patch, height_mm
        The footprint and somewhat more, and (n,) the wanted surface over the skin along the
        normals; above zero, so in the air, at the patch's rim.
    under
        (n,) which points belong to the footprint.
    depth_mm
        Of the flaw: the solid rises a quarter of it, at least 20 µm, above the highest point, so
        that its roof lies clearly in the air.
    sagitta_mm
        How far facets may stand off the wanted surface.
    """
    clear = max(0.02, 0.25 * depth_mm)
    rise = float(height_mm.max()) + clear
    return Cutter(
        removed=patch.solid(
            height_mm,
            np.full(len(height_mm), rise),
            loose_mm=(SPARED * sagitta_mm, 0.25 * clear),
        ),
        added=None,
        skin_mm=patch.skin_mm[under],
        normals=patch.normals[under],
        height_mm=np.minimum(height_mm[under], 0.0),
        above_mm=patch.skin_mm + rise * patch.normals,
    )


def merge(cutters: list[Cutter]) -> Cutter:
    """Return the union of several cutters, which may overlap."""
    removed = tuple(cutter.removed for cutter in cutters if cutter.removed is not None)
    added = tuple(cutter.added for cutter in cutters if cutter.added is not None)
    return Cutter(
        removed=union(removed) if removed else None,
        added=union(added) if added else None,
        skin_mm=np.concatenate([cutter.skin_mm for cutter in cutters]),
        normals=np.concatenate([cutter.normals for cutter in cutters]),
        height_mm=np.concatenate([cutter.height_mm for cutter in cutters]),
        above_mm=np.concatenate([cutter.above_mm for cutter in cutters]),
    )
