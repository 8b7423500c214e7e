"""Round holes of a part, found by their rims: closed, convex, circular edges around air."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from defects.feature_edges import Chain, feature_edges
from defects.surface import SiteError, Surface

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
    radius_mm
        Of the rim.
    depth_mm
        From the rim to the bottom, or through the part.
    through
        Whether it has no bottom.
    """

    chain: Chain
    centre_mm: Floats
    axis: Floats
    radius_mm: float
    depth_mm: float
    through: bool


@lru_cache(maxsize=4)
def holes(surface: Surface) -> tuple[Hole, ...]:
    """Find the round holes of a part, largest first; kept, since many flaws ask for them."""
    found = [_hole(surface, chain) for chain in feature_edges(surface)
             if chain.convex and chain.closed and len(chain.points_mm) > 6]  # fmt: skip
    return tuple(
        sorted((hole for hole in found if hole is not None), key=lambda hole: -hole.radius_mm)
    )


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


def _hole(surface: Surface, chain: Chain) -> Hole | None:
    rim = chain.points_mm[:-1]
    centre = rim.mean(axis=0)
    _, _, axes = np.linalg.svd(rim - centre)
    normal = axes[2]
    away = rim - centre
    radius = np.linalg.norm(away, axis=1)
    mean = float(radius.mean())
    if np.abs(radius - mean).max() > ROUND * mean or np.abs(away @ normal).max() > ROUND * mean:
        return None
    faces = (chain.left_normals[:-1], chain.right_normals[:-1])
    flat = 0 if abs((faces[0] @ normal).mean()) > abs((faces[1] @ normal).mean()) else 1
    axis = normal * np.sign((faces[flat] @ normal).mean())
    # The wall of a hole faces its axis; that of a boss or a shaft faces away.
    if np.sum(faces[1 - flat] * away, axis=1).mean() > -0.5 * mean:
        return None
    depth = _depth(surface, centre, axis, mean)
    if depth is None:
        return None
    return Hole(
        chain=chain, centre_mm=centre, axis=axis, radius_mm=mean, depth_mm=depth[0],
        through=depth[1],
    )  # fmt: skip


def _depth(
    surface: Surface, centre: Floats, axis: Floats, radius: float
) -> tuple[float, bool] | None:
    """Return how deep the hole is and whether it goes through, by the faces of its wall."""
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
