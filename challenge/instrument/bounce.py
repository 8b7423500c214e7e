"""The second bounce: light that leaves the lit stripe and lands on the part again."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.camera import Camera
from challenge.instrument.optical_surface import OpticalSurface
from challenge.instrument.rays import Tree, nearest


@njit(cache=True)
def _trace(
    tree: Tree,
    lines_y: NDArray[np.float64],
    slope_x: NDArray[np.float64],
    camera_y: float,
    toss: NDArray[np.float64],  # (k, 2) uniform in the unit square
    mirror: float,
    albedo: float,
    facet_slope: float,
) -> NDArray[np.float64]:
    """Second hits (lines, rays * k, 8): point, weight, cosines (in, out, half), distance."""
    bundle = toss.shape[0]
    out = np.zeros((lines_y.size, slope_x.size * bundle, 8))
    total = mirror + albedo
    for g in range(lines_y.size):
        for m in range(slope_x.size):
            t, which = nearest(
                tree, (0.0, lines_y[g], 0.0), (slope_x[m], 0.0, 1.0), 1e-3, 1e9, False
            )
            if which < 0:
                continue
            hit = np.array([slope_x[m] * t, lines_y[g], t])
            n = tree.normal[which]
            d = np.array([slope_x[m], 0.0, 1.0]) / np.sqrt(1 + slope_x[m] ** 2)
            if np.dot(d, n) >= 0:
                continue
            a = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
            e1 = np.cross(n, a)
            e1 /= np.sqrt(np.dot(e1, e1))
            e2 = np.cross(n, e1)
            for k in range(bundle):
                # another pattern at every ray, evenly filling the square
                u = (toss[k, 0] + 0.6180339887 * m + 0.7548776662 * g) % 1.0
                v = (toss[k, 1] + 0.5698402910 * m + 0.3819660113 * g) % 1.0
                specular = u * total < mirror
                angle = 2 * np.pi * v
                if specular:
                    share = max(u * total / mirror, 1e-9)
                    tangent = facet_slope * np.sqrt(-np.log(share))
                    h = n + tangent * (np.cos(angle) * e1 + np.sin(angle) * e2)
                    h /= np.sqrt(np.dot(h, h))
                    go = d - 2 * np.dot(d, h) * h
                else:
                    share = min(max((u * total - mirror) / albedo, 0.0), 1.0)
                    rim = np.sqrt(share)
                    go = np.sqrt(1 - share) * n + rim * (np.cos(angle) * e1 + np.sin(angle) * e2)
                if np.dot(go, n) <= 1e-3:
                    continue
                far, landed = nearest(
                    tree, (hit[0], hit[1], hit[2]), (go[0], go[1], go[2]), 1e-4, 1e9, False
                )
                if landed < 0:
                    continue
                place = hit + far * go
                to = np.array([-place[0], lines_y[g] + camera_y - place[1], -place[2]])
                length = np.sqrt(np.dot(to, to))
                n_2 = tree.normal[landed]
                cos_in, cos_out = -np.dot(go, n_2), np.dot(to, n_2) / length
                if cos_in <= 0 or cos_out <= 0:
                    continue
                _, blocker = nearest(
                    tree, (place[0], place[1], place[2]), (to[0], to[1], to[2]), 1e-6, 1.0, True
                )
                if blocker >= 0:
                    continue
                half = to / length - go
                half /= np.sqrt(np.dot(half, half))
                at = m * bundle + k
                out[g, at, :3] = place
                out[g, at, 3] = total / bundle
                out[g, at, 4] = cos_in
                out[g, at, 5] = cos_out
                out[g, at, 6] = np.dot(half, n_2)
                out[g, at, 7] = length
    return out


def second_light(
    tree: Tree,
    camera: Camera,
    surface: OpticalSurface,
    where_mm: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    rays: int = 32,
) -> NDArray[np.float32]:
    """Trace light from the stripe's middle to where it lands and on to the camera.

    Parameters
    ----------
    tree : Tree
        The part in the sensor frame at the path's start.
    where_mm : (n, k, 3)
        True positions of the sensor; the first of each exposure is used.
    rays
        Rays from each lit point.

    Returns
    -------
    (n, columns * rays, 3) : column, row and power relative to the white plate; zero = none
    """
    y = np.ascontiguousarray(where_mm[:, 0, 1])
    side = int(np.sqrt(rays))
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(rays // side)), -1).reshape(-1, 2)
    toss = (grid + rng.random(grid.shape)) / np.array([side, rays // side])
    angles = camera.angles_rad()
    found = _trace(
        tree, y, np.tan(angles), camera.side * camera.base_mm, toss,
        surface.mirror, surface.albedo, surface.facet_slope,
    )  # fmt: skip
    matt = 0.6 * np.cos(camera.triangulation_rad) / np.pi
    range_0 = camera.working_distance_mm / np.cos(camera.triangulation_rad)
    lit = found[..., 3] > 0
    sent = surface.towards(found[..., 4], found[..., 5], found[..., 6]) * found[..., 3]
    length = np.where(lit, found[..., 7], 1.0)
    z = np.where(lit, found[..., 2] - where_mm[:, 0, 2, None], camera.working_distance_mm)
    x = found[..., 0] - where_mm[:, 0, 0, None]
    along = np.where(lit, found[..., 1] - y[:, None], 0.0)
    row = camera.row_of(x, along, z)
    column = np.arctan2(x, z) / camera.step_rad + (camera.columns - 1) / 2
    power = np.where(lit, sent / matt * (range_0 / length) ** 2, 0.0)
    return np.stack([column, row, power], -1).astype(np.float32)
