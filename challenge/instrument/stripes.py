"""Where the sheet's sub-lines meet the part: first hits, sight lines and outgoing light.

A straight scan of constant orientation passes every place several times with the sheet's
width, so that the part is cast once on lines a fraction of the width apart, and every frame
takes the lines that its sheet covers at that instant.
"""

from dataclasses import dataclass, replace
from math import ceil, cos

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.camera import Camera
from challenge.instrument.optical_surface import OpticalSurface
from challenge.instrument.rays import Tree, nearest
from challenge.instrument.sheet import LaserSheet
from challenge.instrument.speckle import phases

_REFRACTION = 1.5
_EDGE_CASTS = 2  # casts in a column; between them the surface goes on along its facet
_MARGIN = 4  # columns beyond the chip that are cast too, for a sensor that strays sideways


@dataclass(frozen=True, kw_only=True, slots=True)
class Stripes:
    """Scatterers of a scan, in the sensor frame at the path's start (mm).

    Attributes
    ----------
    y_mm : (G,)
        The sub-lines' positions along the travel.
    x_mm, z_mm : (G, M)
        Scatterers; `power` is 0 where nothing is hit or the camera is blocked.
    power : (G, M)
        Light sent to the camera relative to a matt plate at the working distance.
    cosine, sine : (G, M)
        Scattering phase.
    below : (G, M, 3) or (1, 1, 3)
        Apparent displacement of light that travelled a millimetre below the surface.
    spacing_mm : float
        Distance of the sub-lines.
    samples : int
        Scatterers in a column.
    """

    y_mm: NDArray[np.float64]
    x_mm: NDArray[np.float64]
    z_mm: NDArray[np.float64]
    power: NDArray[np.float32]
    cosine: NDArray[np.float32]
    sine: NDArray[np.float32]
    below: NDArray[np.float32]
    spacing_mm: float
    samples: int

    def of(self, specimen: int, part_mm: NDArray[np.float64]) -> "Stripes":
        """Return the same scatterers on another specimen.

        Parameters
        ----------
        specimen
            Seed of the scattering phases.
        part_mm : (G * M, 3)
            The scatterers in the part frame, without micro relief.
        """
        cosine, sine = phases(part_mm, specimen)
        shape = self.power.shape
        return replace(self, cosine=cosine.reshape(shape), sine=sine.reshape(shape))


@dataclass(frozen=True, kw_only=True, slots=True)
class Cast:
    """Scatterers of a scan before a specimen is chosen, and where they are on the part.

    Casting rays costs as much as making frames; scans of many specimens share it.
    """

    stripes: Stripes
    part_mm: NDArray[np.float64]


@njit(cache=True)
def _cast(
    tree: Tree,
    y_mm: NDArray[np.float64],
    slope_x: NDArray[np.float64],
    camera_y_mm: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Cast every laser ray, then from its hit the sight line to the camera."""
    lines, rays = y_mm.size, slope_x.size
    depth = np.full((lines, rays), np.nan)
    triangle = np.full((lines, rays), -1)
    visible = np.zeros((lines, rays), np.bool_)
    for g in range(lines):
        for m in range(rays):
            t, which = nearest(tree, (0.0, y_mm[g], 0.0), (slope_x[m], 0.0, 1.0), 1e-3, 1e9, False)
            if which < 0:
                continue
            depth[g, m] = t
            triangle[g, m] = which
            _, blocker = nearest(
                tree, (slope_x[m] * t, y_mm[g], t), (-slope_x[m] * t, camera_y_mm, -t),
                1e-6, 1.0, True,
            )  # fmt: skip
            visible[g, m] = blocker < 0
    return depth, triangle, visible


def spacings(sheet: LaserSheet, camera: Camera, pitch_mm: float) -> tuple[float, int]:
    """Distance of sub-lines and scatterers in a column that resolve speckle and sheet."""
    grain = camera.amplitude_spread_mm(sheet.wavelength_mm)
    widest = min(1.3 * grain / cos(camera.triangulation_rad), 0.6 * sheet.waist_mm)
    return pitch_mm / ceil(pitch_mm / widest), ceil(camera.column_pitch_mm / (1.3 * grain))


def first_hits(
    tree: Tree, y_mm: NDArray[np.float64], camera: Camera, *, every: int = 1
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Cast one ray for each column at positions along the travel: pure geometry.

    Parameters
    ----------
    every
        Leave out all columns but every so many.

    Returns
    -------
    depth_mm : (n, columns)
        NaN where nothing is hit.
    normal : (n, columns, 3)
    visible : (n, columns) bool
        The sight line to the camera is free.
    """
    slope = np.asarray(np.tan(camera.angles_rad()[::every]), np.float64)
    depth, triangle, visible = _cast(
        tree, np.asarray(y_mm, np.float64), slope, camera.side * camera.base_mm
    )
    return depth, tree.normal[triangle], visible


def lay_out(
    tree: Tree,
    to_part: NDArray[np.float64],
    sheet: LaserSheet,
    camera: Camera,
    surface: OpticalSurface,
    *,
    first_mm: float,
    last_mm: float,
    pitch_mm: float,
) -> Cast:
    """Cast the sub-lines between two positions along the travel.

    Parameters
    ----------
    tree : Tree
        The part in the sensor frame at the path's start.
    to_part : (4, 4)
        From that frame to the part's, for what is fixed to the part.
    first_mm, last_mm
        Extent along y; the caller adds the sheet's width.
    pitch_mm
        Profile pitch; sub-lines divide it evenly.

    Returns
    -------
    Cast
    """
    spacing, samples = spacings(sheet, camera, pitch_mm)
    y = first_mm + spacing * np.arange(ceil((last_mm - first_mm) / spacing) + 1, dtype=np.float64)
    met = _met(tree, y, camera, surface)
    x, z, owner = _scatterers(met, camera, samples)
    points = np.stack([x, np.broadcast_to(y[:, None], x.shape), z], -1)
    part = points @ to_part[:3, :3].T + to_part[:3, 3]
    power = np.nan_to_num(met.sent[:, owner]) * surface.brightness(part)
    if surface.relief_mm > 0:
        rise = surface.relief(part)  # along the part's z, towards the sensor
        up = to_part[2, :3]  # the part's z in the sensor frame
        x = x + rise * up[0]
        z = z + rise * up[2]
    below = np.zeros((1, 1, 3), np.float32)
    if surface.depth_mm > 0:
        below = np.ascontiguousarray(_below(met).astype(np.float32)[:, owner])
    none = np.zeros((0, 0), np.float32)
    stripes = Stripes(
        y_mm=y,
        x_mm=np.ascontiguousarray(x),
        z_mm=np.ascontiguousarray(z),
        power=np.ascontiguousarray(power, np.float32),
        cosine=none,
        sine=none,
        below=below,
        spacing_mm=spacing,
        samples=samples,
    )
    return Cast(stripes=stripes, part_mm=part.reshape(-1, 3))


@dataclass(frozen=True, kw_only=True, slots=True)
class _Met:
    """Where casts (G, K) meet the part, and the light that they send to the camera.

    Attributes
    ----------
    slope : (K,) of each ray
    light : (K, 3) unit vectors towards the laser
    sent : (G, K) light sent to the camera relative to a matt plate at the working distance
    """

    slope: NDArray[np.float64]
    z_mm: NDArray[np.float64]
    normal: NDArray[np.float64]
    light: NDArray[np.float64]
    cos_in: NDArray[np.float64]
    sent: NDArray[np.float64]


def _met(tree: Tree, y: NDArray[np.float64], camera: Camera, surface: OpticalSurface) -> _Met:
    """Cast `_EDGE_CASTS` rays a column, and each hit's sight line."""
    first, wide = _first_angle(camera), camera.columns + 2 * _MARGIN
    coarse = first + camera.step_rad * (np.arange(wide * _EDGE_CASTS) + 0.5) / _EDGE_CASTS
    slope = np.asarray(np.tan(coarse), np.float64)
    camera_y = camera.side * camera.base_mm
    z, triangle, visible = _cast(tree, y, slope, camera_y)
    normal = tree.normal[triangle]
    light = np.stack([slope, np.zeros_like(slope), np.ones_like(slope)], -1)
    light = -light / np.linalg.norm(light, axis=1)[:, None]
    view = np.stack([-slope * z, np.full_like(z, camera_y), -z], -1)
    distance = np.linalg.norm(view, axis=-1)
    view /= distance[..., None]
    half = view + light
    half /= np.linalg.norm(half, axis=-1)[..., None]
    cos_in = np.einsum("gmi,mi->gm", normal, light)
    sent = surface.towards(
        cos_in, np.einsum("gmi,gmi->gm", normal, view), np.einsum("gmi,gmi->gm", normal, half)
    )
    matt = 0.6 * cos(camera.triangulation_rad) / np.pi  # a white plate, reference of exposure
    range_0 = camera.working_distance_mm / cos(camera.triangulation_rad)
    sent = np.where(visible, sent / matt * (range_0 / distance) ** 2, 0.0)
    return _Met(slope=slope, z_mm=z, normal=normal, light=light, cos_in=cos_in, sent=sent)


def _first_angle(camera: Camera) -> float:
    return float(-camera.fov_rad / 2 - (_MARGIN + 0.5) * camera.step_rad)


def _scatterers(
    met: _Met, camera: Camera, samples: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Lay scatterers on the facet of the nearest cast: x and z (G, M), and whose facet (M,)."""
    wide = camera.columns + 2 * _MARGIN
    angle = _first_angle(camera) + camera.step_rad * (np.arange(wide * samples) + 0.5) / samples
    owner = np.minimum((np.arange(angle.size) * _EDGE_CASTS) // samples, wide * _EDGE_CASTS - 1)
    slope, normal, z = np.tan(angle), met.normal, met.z_mm
    offset = normal[..., 0] * met.slope * z + normal[..., 2] * z  # n·(hit - origin)
    with np.errstate(divide="ignore", invalid="ignore"):
        z_fine = offset[:, owner] / (normal[:, owner, 0] * slope + normal[:, owner, 2])
    z_near = z[:, owner]
    # a facet seen edge-on: stay at the cast's own depth rather than run along it
    run = 4 * camera.column_pitch_mm
    z_fine = np.where(np.abs(z_fine - z_near) < run, z_fine, z_near)
    x_fine = np.nan_to_num(z_fine * slope)
    return x_fine, np.nan_to_num(z_fine, nan=camera.working_distance_mm), owner


def _below(met: _Met) -> NDArray[np.float64]:
    """Apparent displacement (G, K, 3) of light a millimetre below the surface, refracted."""
    ratio, cos_in = 1 / _REFRACTION, np.clip(met.cos_in, 0, 1)
    sine_2 = ratio**2 * (1 - cos_in**2)
    inward = (ratio * cos_in - np.sqrt(1 - sine_2))[..., None] * met.normal
    path = -ratio * met.light[None] + inward
    # seen through the surface: the normal part of the path looks shorter
    sunk = np.einsum("gmi,gmi->gm", path, met.normal)[..., None] * met.normal
    return np.asarray(path - sunk * (1 - 1 / _REFRACTION))
