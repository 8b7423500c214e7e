"""A patch of skin as a mesh of its own, from which cutters are raised and sunk along the normal."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from defects.carving.solid import Cutter, Solid
from defects.seats.feature_edges import Frames
from defects.surface.surface import Site, SiteError, Surface

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


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
    """

    skin_mm: Floats
    normals: Floats
    faces: Ints
    first: Floats
    second: Floats

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
            (r,) rising radius ratios of the rings, above 0.

        Raises
        ------
        SiteError
            When the disk crosses an edge of the part or folds.
        """
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
        node = 1 + np.arange(k * r, dtype=np.int32).reshape(k, r)
        after = np.roll(node, -1, axis=0)
        fan = np.stack([np.zeros(k, np.int64), node[:, 0], after[:, 0]], axis=1)
        patch = cls(
            skin_mm=skin,
            normals=normals,
            faces=np.concatenate([fan, _quads(node, after)]).astype(np.int32),
            first=np.concatenate([[0.0], np.tile(rho, k)]),
            second=np.concatenate([[0.0], np.repeat(angles, r)]),
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
        node = np.arange(n * width, dtype=np.int32).reshape(n, width)
        across = np.concatenate([-across_mm[::-1], [0.0], across_mm])
        patch = cls(
            skin_mm=skin.reshape(-1, 3),
            normals=both(normals, walk.normals).reshape(-1, 3),
            faces=_quads(node[1:], node[:-1]).astype(np.int32),
            first=np.repeat(along_mm, width),
            second=np.tile(across, n),
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
        node = np.arange(n * k, dtype=np.int32).reshape(n, k)
        patch = cls(
            skin_mm=skin.reshape(-1, 3),
            normals=np.repeat(normal, k, axis=0),
            faces=_quads(node[1:], node[:-1]).astype(np.int32),
            first=np.repeat(along_mm, k),
            second=np.tile(across, n),
        )
        patch._check()
        return patch

    def solid(self, low_mm: Floats, high_mm: Floats) -> Solid:
        """Return the closed solid between two heights (n,) above the skin, `low` below `high`."""
        used = self._used()
        number = np.full(len(self.skin_mm), -1, np.int32)
        number[used] = np.arange(len(used), dtype=np.int32)
        faces = number[self.faces]
        count = len(used)
        low = self.skin_mm[used] + low_mm[used, None] * self.normals[used]
        high = self.skin_mm[used] + high_mm[used, None] * self.normals[used]
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        key = edges.astype(np.int64) @ np.array([count, 1])
        rim = edges[~np.isin(key, edges[:, ::-1].astype(np.int64) @ np.array([count, 1]))]
        a, b = rim[:, 0], rim[:, 1]
        walls = np.concatenate(
            [np.stack([a, b, b + count], 1), np.stack([a, b + count, a + count], 1)]
        )
        return Solid(
            vertices_mm=np.concatenate([low, high]),
            faces=np.concatenate([faces[:, ::-1], faces + count, walls]).astype(np.int32),
        )

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
        a, b, c = (self.skin_mm[self.faces[:, i]] for i in range(3))
        cross = np.cross(b - a, c - a)
        mean = self.normals[self.faces].sum(axis=1)
        size = np.linalg.norm(cross, axis=1) * np.linalg.norm(mean, axis=1)
        if not (np.einsum("ij,ij->i", cross, mean) > 0.2 * size).all():
            raise SiteError("the surface bends too strongly for a flaw of this size")


def tangent_frame(site: Site) -> tuple[Floats, Floats]:
    """Return the site's heading and the direction to the left of it, unit vectors (3,)."""
    return site.direction(), site.direction(np.pi / 2)


def reshape(
    lid: Patch,
    lid_height_mm: Floats,
    pocket: Patch | None,
    pocket_height_mm: Floats | None,
    margin_mm: float,
    underside_mm: Floats | None = None,
) -> Cutter:
    """Give the skin another surface.

    What lies above the wanted surface goes, and a lid with the wanted surface on top comes,
    so that removed and added faces never nearly coincide: the pocket is cut `margin_mm`
    deeper than wanted and the lid is twice that thick. The wanted surface must cross the skin
    at an angle and end below it.

    Parameters
    ----------
    lid, lid_height_mm
        The whole footprint and (n,) the wanted surface above the skin along the local normal.
    pocket, pocket_height_mm
        Where the wanted surface lies below the skin and some way on, but less than the lid;
        may have coarser facets, as long as they stay within the margin. None: nothing is removed.
    margin_mm
        See above.
    underside_mm
        (n,) the lid's lower side over the skin, where a thin sheet's far skin moves, too; None:
        the lid is `2 * margin_mm` thick.
    """
    top = lid_height_mm > 0.2 * max(float(lid_height_mm.max()), 1e-9)
    above = (lid.skin_mm + lid_height_mm[:, None] * lid.normals)[top]
    removed = None
    if pocket is not None and pocket_height_mm is not None:
        rise = float(max(lid_height_mm.max(), 0.0)) + 2 * margin_mm
        high = np.full(len(pocket.skin_mm), rise)
        removed = pocket.solid(np.minimum(pocket_height_mm, 0.0) - margin_mm, high)
        roof = (pocket.skin_mm + rise * pocket.normals)[pocket._used()]
        above = np.concatenate([above, roof])
    low = np.minimum(lid_height_mm, 0.0) - 2 * margin_mm if underside_mm is None else underside_mm
    return Cutter(
        removed=removed,
        added=lid.solid(low, lid_height_mm),
        skin_mm=lid.skin_mm,
        normals=lid.normals,
        height_mm=lid_height_mm,
        above_mm=above,
    )


def dig(patch: Patch, height_mm: Floats, under: NDArray[np.bool_], depth_mm: float) -> Cutter:
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
    """
    rise = float(height_mm.max()) + max(0.02, 0.25 * depth_mm)
    return Cutter(
        removed=patch.solid(height_mm, np.full(len(height_mm), rise)),
        added=None,
        skin_mm=patch.skin_mm[under],
        normals=patch.normals[under],
        height_mm=np.minimum(height_mm[under], 0.0),
        above_mm=patch.skin_mm + rise * patch.normals,
    )


def merge(cutters: list[Cutter]) -> Cutter:
    """Return one cutter that does what several do, which may overlap."""
    removed = tuple(cutter.removed for cutter in cutters if cutter.removed is not None)
    added = tuple(cutter.added for cutter in cutters if cutter.added is not None)
    return Cutter(
        removed=Solid.union(removed) if removed else None,
        added=Solid.union(added) if added else None,
        skin_mm=np.concatenate([cutter.skin_mm for cutter in cutters]),
        normals=np.concatenate([cutter.normals for cutter in cutters]),
        height_mm=np.concatenate([cutter.height_mm for cutter in cutters]),
        above_mm=np.concatenate([cutter.above_mm for cutter in cutters]),
    )


def _quads(here: Ints, there: Ints) -> Ints:
    """Join two rows (k, r) of node numbers, the second to the left of the first, by triangles."""
    a, b = here[:, :-1].ravel(), here[:, 1:].ravel()
    c, d = there[:, 1:].ravel(), there[:, :-1].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
