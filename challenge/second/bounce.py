"""Second bounces: light of the line that a wall sends on to another, and that to the camera."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.rays import Tree, nearest
from challenge.second.facets import Facets

Floats = NDArray[np.float64]
RAYS = 24
"""Rays that leave a lit place."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Landed:
    """Where second light is seen.

    Attributes
    ----------
    point : (n, 3) sensor frame
    column : (n,) of the lit place that sent it
    power : (n,) relative to the line's light in a column
    """

    point: Floats
    column: NDArray[np.int64]
    power: Floats


@njit(cache=True)
def _trace(
    tree: Tree, x: Floats, y: float, to_camera: Floats, toss: Floats, surface: Floats
) -> Floats:
    """Second hits (m * rays, 10): point, cosine in, normal, direction it came along.

    Parameters
    ----------
    surface : (3,) mirror, albedo, facets' slope
    """
    rays, mirror, albedo, slope = toss.shape[0], surface[0], surface[1], surface[2]
    out = np.zeros((x.size * rays, 10))
    for m in range(x.size):
        t, which = nearest(tree, (x[m], y, 0.0), (0.0, 0.0, 1.0), 0.0, 1e9, False)
        if which < 0 or tree.normal[which, 2] >= 0:
            continue
        n = tree.normal[which]
        a = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
        e1 = np.cross(n, a)
        e1 /= np.sqrt(np.dot(e1, e1))
        e2 = np.cross(n, e1)
        for k in range(rays):
            u = (toss[k, 0] + 0.6180339887 * m) % 1.0
            angle = 2 * np.pi * ((toss[k, 1] + 0.5698402910 * m) % 1.0)
            around = np.cos(angle) * e1 + np.sin(angle) * e2
            share = mirror / (mirror + albedo)
            if u < share:
                # Trowbridge-Reitz: tan² of a facet's tilt is slope² u / (1 - u)
                part = u / share
                h = n + slope * np.sqrt(part / max(1 - part, 1e-6)) * around
                h /= np.sqrt(np.dot(h, h))
                go = np.array([0.0, 0.0, 1.0]) - 2 * h[2] * h
            else:
                part = (u - share) / (1 - share)
                go = np.sqrt(1 - part) * n + np.sqrt(part) * around
            if np.dot(go, n) <= 1e-3:
                continue
            start = np.array([x[m], y, t]) + 1e-6 * n
            far, landed = nearest(
                tree, (start[0], start[1], start[2]), (go[0], go[1], go[2]), 1e-4, 1e9, False
            )
            if landed < 0:
                continue
            place, other = start + far * go, tree.normal[landed]
            if np.dot(go, other) >= 0 or np.dot(to_camera, other) <= 0:
                continue
            place = place + 1e-6 * other
            _, blocker = nearest(
                tree, (place[0], place[1], place[2]),
                (to_camera[0], to_camera[1], to_camera[2]), 1e-4, 1e9, True,
            )  # fmt: skip
            if blocker >= 0:
                continue
            at = m * rays + k
            out[at, :3], out[at, 3] = place, -np.dot(go, other)
            out[at, 4:7], out[at, 7:] = other, go
    return out


def second_light(
    tree: Tree, facets: Facets, x_mm: Floats, y_mm: float, to_camera: Floats,
    rng: np.random.Generator,
) -> Landed:  # fmt: skip
    """Follow light from the line's middle at y to where it lands and is seen.

    A ray carries albedo + mirror over their number of the light that came down; where it lands
    the surface sends radiance f (n·c) of it to the camera.
    """
    toss = np.stack([(np.arange(RAYS) + rng.random(RAYS)) / RAYS, rng.random(RAYS)], -1)
    slope = float(np.sqrt(facets.slope_along * facets.slope_across))
    found = _trace(
        tree, x_mm, y_mm, to_camera, toss, np.array([facets.mirror, facets.albedo, slope])
    )
    at = np.flatnonzero(found[:, 3] > 0)
    hit = found[at]
    normal, came = hit[:, 4:7], hit[:, 7:]
    half = to_camera - came
    half = half / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
    upright = (half * normal).sum(1)
    tilt = np.sqrt(np.maximum(1 - upright**2, 0.0))
    even = Facets(slope_along=slope, slope_across=slope)
    lobe = facets.mirror * even.density(upright, tilt, np.zeros_like(tilt))
    seen = normal @ to_camera
    sent = facets.albedo / np.pi * seen + lobe / (4 * np.maximum(hit[:, 3], 0.05))
    power = (facets.mirror + facets.albedo) / RAYS * sent
    return Landed(point=hit[:, :3], column=at // RAYS, power=power)
