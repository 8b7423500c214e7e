"""Round holes of a part, found by their rims: closed, convex, circular edges around air."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from defects.seats.feature_edges import Chain, feature_edges
from defects.surface.surface import SiteError, Surface

Floats = NDArray[np.float64]

ROUND = 0.02
"""Largest departure of a rim from its circle and its plane, in radii. A polygon of twelve
corners, the coarsest circle that CAD exports by default, lies on its circle at the corners; the
bound leaves room for mending and for rims given in single precision."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Hole:
    """A round hole.

    Parameters
    ----------
    chain
        Its rim.
    centre_mm, axis
        (3,) centre of the rim and the unit direction out of the part.
    radius_mm, bore_mm
        Of the rim, and of the straight wall below it: less where the rim is chamfered.
    depth_mm
        From the rim to the bottom, or through the part.
    through
        Whether it has no bottom.
    """

    chain: Chain
    centre_mm: Floats
    axis: Floats
    radius_mm: float
    bore_mm: float
    depth_mm: float
    through: bool


@lru_cache(maxsize=4)
def holes(surface: Surface) -> tuple[Hole, ...]:
    """Find the round holes of a part, largest first; cached.

    A chamfered or countersunk hole is known by its outer rim.
    """
    rims = [rim for chain in feature_edges(surface)
            if chain.convex and chain.closed and len(chain.points_mm) > 6
            and (rim := _rim(chain)) is not None]  # fmt: skip
    straight, sloped = [], []
    for rim in rims:
        hole = _hole(surface, rim)
        if hole is not None:
            straight.append(hole)
        else:
            sloped.append(rim)
    found = []
    for hole in straight:
        outer = [rim for rim in sloped if _chamfers(rim, hole)]
        found.append(hole if not outer else _from(max(outer, key=lambda rim: rim.radius_mm), hole))
    return tuple(sorted(found, key=lambda hole: -hole.radius_mm))


def nearest_hole(surface: Surface, point_mm: Floats) -> Hole:
    """Return the hole whose rim is nearest to a point (3,).

    Raises
    ------
    SiteError
        When the part has no round hole.
    """
    found = holes(surface)
    if not found:
        raise SiteError("the part has no round hole")
    gaps = [np.linalg.norm(hole.chain.points_mm - point_mm, axis=1).min() for hole in found]
    return found[int(np.argmin(gaps))]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Rim:
    """A round edge around air: its circle, and the direction out of the part."""

    chain: Chain
    centre_mm: Floats
    axis: Floats
    radius_mm: float


def _rim(chain: Chain) -> _Rim | None:
    corners = chain.points_mm[:-1]
    centre = corners.mean(axis=0)
    _, _, axes = np.linalg.svd(corners - centre)
    normal = axes[2]
    away = corners - centre
    radius = np.linalg.norm(away, axis=1)
    mean = float(radius.mean())
    if np.abs(radius - mean).max() > ROUND * mean or np.abs(away @ normal).max() > ROUND * mean:
        return None
    faces = (chain.left_normals[:-1], chain.right_normals[:-1])
    tilt = [abs(float((side @ normal).mean())) for side in faces]
    flat = int(tilt[1] > tilt[0])
    axis = normal * np.sign((faces[flat] @ normal).mean())
    # The wall of a hole faces its axis; that of a boss or a shaft faces away.
    if np.sum(faces[1 - flat] * away, axis=1).mean() > -0.5 * mean:
        return None
    return _Rim(chain=chain, centre_mm=centre, axis=axis, radius_mm=mean)


def _hole(surface: Surface, rim: _Rim) -> Hole | None:
    depth = _depth(surface, rim.centre_mm, rim.axis, rim.radius_mm)
    if depth is None:
        return None
    return Hole(
        chain=rim.chain, centre_mm=rim.centre_mm, axis=rim.axis, radius_mm=rim.radius_mm,
        bore_mm=rim.radius_mm, depth_mm=depth[0], through=depth[1],
    )  # fmt: skip


def _chamfers(rim: _Rim, hole: Hole) -> bool:
    """Return whether a rim is the outer end of a chamfer of a hole."""
    apart = rim.centre_mm - hole.centre_mm
    up = float(apart @ hole.axis)
    aside = float(np.linalg.norm(apart - up * hole.axis))
    same = float(rim.axis @ hole.axis) > 0.99 and aside < ROUND * hole.radius_mm
    return same and hole.radius_mm < rim.radius_mm and 0 < up < 2 * rim.radius_mm


def _from(rim: _Rim, hole: Hole) -> Hole:
    """Return a hole as its outer rim shows it."""
    up = float((rim.centre_mm - hole.centre_mm) @ hole.axis)
    return replace(
        hole, chain=rim.chain, centre_mm=rim.centre_mm, radius_mm=rim.radius_mm,
        depth_mm=hole.depth_mm + up,
    )  # fmt: skip


def _depth(
    surface: Surface, centre: Floats, axis: Floats, radius: float
) -> tuple[float, bool] | None:
    """Return the hole's depth and whether it is a through hole, from the faces of its wall."""
    corners = surface.vertices_mm[surface.faces]
    down = (centre - corners) @ axis
    middle = corners.mean(axis=1)
    off = middle - centre
    off -= (off @ axis)[:, None] * axis
    apart = np.linalg.norm(off, axis=1)
    wall = (
        (np.abs(surface.normals @ axis) < 0.1)
        & (np.abs(apart - radius) < 0.05 * radius)
        & (down.min(axis=1) < 0.5 * radius)
        & (down.max(axis=1) > 0)
    )
    if not wall.any():
        return None
    bottom = float(down[wall].max())
    # A floor (or a drill's cone) under the axis closes the hole.
    closing = (surface.normals @ axis > 0.3) & (apart < 0.7 * radius)
    closing &= (np.abs(down - bottom).min(axis=1) < 1.5 * radius) & (down.min(axis=1) > 0)
    return bottom, not bool(closing.any())
