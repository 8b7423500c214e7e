"""The surface under the sheet on a fine grid: depth, brightness towards the camera, layers."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.rays import Tree, nearest
from challenge.second.facets import Facets

Floats = NDArray[np.float64]
GRAIN_MM = 0.01
"""How far a surface moves until its speckle is another: a speckle's size on the part."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cells:
    """Cells (k, m) that scatter: displacement in y, z from the surface, and brightness."""

    along_mm: Floats
    z_mm: Floats
    bright: Floats


@dataclass(frozen=True, kw_only=True, slots=True)
class Lit:
    """All cells that the sheet may light: their y (k,) in the sensor's frame, layer by layer."""

    y_mm: Floats
    layers: tuple[Cells, ...]


@njit(cache=True)
def heights(
    tree: Tree, x: Floats, y: Floats, depth: Floats, which: NDArray[np.int64]
) -> None:
    """First hits of rays along +z from (x, y, 0) on a grid; fills depth (n, m) and triangles."""
    for i in range(y.size):
        for j in range(x.size):
            far, triangle = nearest(tree, (x[j], y[i], 0.0), (0.0, 0.0, 1.0), 0.0, 1e9, False)
            if triangle >= 0:
                depth[i, j], which[i, j] = far, triangle


def cast(tree: Tree, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Depth (k, m), NaN without a hit, and normals (k, m, 3) under a grid."""
    depth = np.full((y.size, x.size), np.nan)
    which = np.zeros(depth.shape, np.int64)
    heights(tree, x, y, depth, which)
    return depth, tree.normal[which]


def speckle_rng(specimen: int, start: Floats) -> np.random.Generator:
    """Return the generator of a specimen's speckle as it is seen from one place.

    Speckle is the part's. A scan from the same place meets the same speckle, one from elsewhere (by
    a grain or more) another. Were it the scan's grid's, all recordings of a specimen would share
    it, column by column.
    """
    place = np.round(start / GRAIN_MM).astype(np.int64).ravel()
    return np.random.default_rng([specimen, 2, *(place % 2**32).tolist()])


def lit_cells(
    tree: Tree, facets: Facets, x: Floats, y: Floats, start: Floats, to_camera: Floats,
    specimen: int,
) -> Lit:  # fmt: skip
    """Light every cell of a grid with unit irradiance.

    Parameters
    ----------
    start : (4, 4) sensor -> part
    to_camera : (3,) sensor frame
    specimen : whose speckle
    """
    depth, normal = cast(tree, x, y)
    points = np.stack(np.broadcast_arrays(x, y[:, None], depth), -1)
    points = points @ start[:3, :3].T + start[:3, 3]
    lay = np.array([np.cos(facets.lay_rad), np.sin(facets.lay_rad), 0.0]) @ start[:3, :3]
    lay = lay - (normal @ lay)[..., None] * normal
    lay = lay / np.maximum(np.linalg.norm(lay, axis=-1, keepdims=True), 1e-9)
    base, specular = facets.towards(normal, lay, np.array([0.0, 0.0, -1.0]), to_camera)
    grain = facets.speckle(depth.shape, speckle_rng(specimen, start))
    shown = visible(depth, y, to_camera) * np.nan_to_num(facets.albedo_pattern(points)) * grain
    if facets.coat is None:
        whole = np.where(np.isfinite(depth), shown * (base + specular), 0.0)
        return Lit(y_mm=y, layers=(Cells(along_mm=np.zeros_like(depth), z_mm=depth, bright=whole),))
    layers = []
    for layer in facets.coat.layers(normal, points, to_camera):
        light = np.nan_to_num(shown * (base * layer.base + specular * layer.specular))
        layers.append(
            Cells(along_mm=np.nan_to_num(layer.along_mm), z_mm=depth + layer.deeper_mm,
                  bright=np.where(np.isfinite(depth), light, 0.0))
        )  # fmt: skip
    return Lit(y_mm=y, layers=tuple(layers))


def visible(depth: Floats, y: Floats, to_camera: Floats) -> NDArray[np.bool_]:
    """Cells that no other of their column hides from a telecentric camera in the y-z plane."""
    side = 1 if to_camera[1] > 0 else -1
    tan = abs(to_camera[1] / to_camera[2])
    across = side * y[:, None] / tan + np.where(np.isfinite(depth), depth, np.inf)
    towards = across[::-1] if side > 0 else across
    nearer = np.minimum.accumulate(towards, axis=0)
    nearer = nearer[::-1] if side > 0 else nearer
    return np.asarray(across <= nearer + 1e-9)
