"""Real flaws as solids: dents, pits, scratches and cracks, cut from a part along the view.

A cutter is a closed patch: its bottom lies below the surface by the flaw's depth, rises to the
surface at the flaw's rim and ends above it; its lid runs above the surface. Both follow the
surface, whatever its form: every vertex is cast for itself.
"""

from dataclasses import dataclass

import manifold3d
import numpy as np
from numpy.typing import NDArray

from challenge.cases.seeds import log_uniform

Floats = NDArray[np.float64]

KINDS = ("dent", "pit", "scratch", "crack")
SIZES = ("small", "large")
# Least and most of length, width and depth, mm; drawn log-uniformly.
RANGES: dict[tuple[str, str], tuple[tuple[float, float], ...]] = {
    ("dent", "small"): ((1.2, 2.0), (1.2, 2.0), (0.04, 0.09)),
    ("dent", "large"): ((2.5, 4.0), (2.5, 4.0), (0.06, 0.18)),
    ("pit", "small"): ((0.35, 0.5), (0.35, 0.5), (0.05, 0.12)),
    ("pit", "large"): ((0.6, 1.0), (0.6, 1.0), (0.08, 0.25)),
    ("scratch", "small"): ((2.0, 3.5), (0.25, 0.35), (0.03, 0.05)),
    ("scratch", "large"): ((4.0, 7.0), (0.4, 0.6), (0.04, 0.08)),
    ("crack", "small"): ((1.5, 3.0), (0.12, 0.18), (0.08, 0.15)),
    ("crack", "large"): ((3.0, 5.0), (0.2, 0.3), (0.15, 0.4)),
}
_REACH = 1.3  # of a cutter beyond the flaw's rim, in half widths


@dataclass(frozen=True, kw_only=True, slots=True)
class Flaw:
    """A flaw as drawn, not yet anywhere.

    Attributes
    ----------
    kind, size
        One of `KINDS` and of `SIZES`.
    length_mm, width_mm, depth_mm
        At the surface, seen along the view; depth along the view.
    track_mm : (k, 2)
        Points along the flaw's middle, in a plane across the view, about its own centre.
    """

    kind: str
    size: str
    length_mm: float
    width_mm: float
    depth_mm: float
    track_mm: Floats

    @property
    def half_width_mm(self) -> float:
        """Half of the width at the surface."""
        return self.width_mm / 2


def draw_flaw(kind: str, size: str, rng: np.random.Generator) -> Flaw:
    """Draw a flaw of one kind and size in a random direction."""
    length, width, depth = (
        log_uniform(rng, low, high) for low, high in RANGES[kind, size]
    )
    heading = rng.uniform(0, 2 * np.pi)
    step = 0.08 if kind == "pit" else 0.25
    count = max(5, int(np.ceil(length / step)) + 1)
    turn = np.zeros(count)
    if kind == "scratch":
        turn = np.linspace(-0.5, 0.5, count) * rng.uniform(-0.6, 0.6)
    elif kind == "crack":
        turn = np.cumsum(rng.normal(0, 0.25, count)) - 0.3 * rng.uniform(-1, 1)
        turn += rng.uniform(0.2, 0.35, count) * rng.choice([-1, 1], count)
    track = np.cumsum(np.stack([np.cos(heading + turn), np.sin(heading + turn)], 1), axis=0)
    track *= length / (count - 1)
    return Flaw(
        kind=kind, size=size, length_mm=length, width_mm=width, depth_mm=depth,
        track_mm=track - (track.max(0) + track.min(0)) / 2,
    )  # fmt: skip


def patch_of(flaw: Flaw) -> tuple[Floats, Floats]:
    """Return the patch of a flaw: points across the view and how deep they lie.

    Returns
    -------
    plane_mm : (k, m, 2)
        About the flaw's centre.
    depth_mm : (k, m)
        Positive below the surface, 0 at the rim, negative beyond it.
    """
    half = flaw.half_width_mm
    across = np.linspace(-_REACH, _REACH, 9 if flaw.kind == "crack" else 17)
    if flaw.kind in ("dent", "pit"):
        along = np.linspace(-_REACH, _REACH, 17)
        axis = flaw.track_mm[-1] - flaw.track_mm[0]
        axis = axis / np.linalg.norm(axis)
        u = along[:, None] * np.ones_like(across)
        v = np.ones_like(along)[:, None] * across
        plane = u[..., None] * axis * flaw.length_mm / 2
        plane = plane + v[..., None] * np.array([-axis[1], axis[0]]) * half
        rho_2 = u**2 + v**2
        # a dent is a paraboloid, a pit has steep walls and a flat bottom
        shape = 1 - rho_2 if flaw.kind == "dent" else 1 - rho_2**2
    else:
        track = flaw.track_mm
        forward = np.gradient(track, axis=0)
        forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
        # a cutter goes on beyond the flaw's ends, where it has left the surface
        ends = 0.35 * flaw.width_mm + 0.1
        track = np.concatenate([[track[0] - ends * forward[0]], track,
                                [track[-1] + ends * forward[-1]]])  # fmt: skip
        forward = np.concatenate([forward[:1], forward, forward[-1:]])
        side = np.stack([-forward[:, 1], forward[:, 0]], 1)
        plane = track[:, None] + (across * half)[None, :, None] * side[:, None]
        # shallower over the last quarter to each end
        at = np.linspace(-1, 1, len(track) - 2)
        run = np.concatenate([[_REACH], np.clip((np.abs(at) - 0.75) / 0.25, 0, 1), [_REACH]])
        if flaw.kind == "scratch":
            shape = 1 - across[None, :] ** 2 - run[:, None] ** 2
        else:
            shape = 1 - np.maximum(np.abs(across)[None, :], run[:, None])
    return plane, flaw.depth_mm * np.maximum(shape, -0.7)


def cutter(bottom_mm: Floats, lid_mm: Floats) -> manifold3d.Manifold:
    """Close a patch's bottom and lid (k, m, 3), z away from the sensor, to a solid.

    Raises
    ------
    ValueError
        Where that is no solid.
    """
    k, m = bottom_mm.shape[:2]
    number = np.arange(k * m).reshape(k, m)
    a, b = number[:-1, :-1].ravel(), number[1:, :-1].ravel()
    c, d = number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    sheet = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    rim = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
    after = np.roll(rim, -1)
    low, high = 0, k * m
    walls = np.concatenate(
        [np.stack([after + low, rim + low, rim + high], 1),
         np.stack([after + low, rim + high, after + high], 1)]
    )  # fmt: skip
    faces = np.concatenate([sheet + low, sheet[:, ::-1] + high, walls])
    points = np.concatenate([bottom_mm.reshape(-1, 3), lid_mm.reshape(-1, 3)])
    solid = solid_from(points, faces)
    if solid.volume() < 0:
        solid = solid_from(points, faces[:, ::-1])
    if solid.status() != manifold3d.Error.NoError or solid.volume() <= 0:
        raise ValueError(f"a flaw's cutter is no solid: {solid.status()}")
    return solid


def solid_from(points_mm: Floats, faces: NDArray[np.integer]) -> manifold3d.Manifold:
    """Make a solid of a mesh in double precision."""
    return manifold3d.Manifold(
        manifold3d.Mesh64(
            vert_properties=np.ascontiguousarray(points_mm, np.float64),
            tri_verts=np.ascontiguousarray(faces, np.uint64),
        )
    )
