"""Flawed specimens of a part: the path of a scan, flaws cut where it sees the part, labels.

All three sets of training data share these solids and paths; the renderer alone differs.
"""

from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import manifold3d
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from challenge.cases.parts import solid_of
from challenge.instrument.instrument import Path, Solid
from challenge.instrument.rays import Tree, nearest, plant
from challenge.payoff.flaws import (
    KINDS,
    RANGES,
    SIZES,
    Flaw,
    cutter,
    draw_flaw,
    patch_of,
    solid_from,
)
from challenge.payoff.sights import Sight, moved

Floats = NDArray[np.float64]

LABEL_MM = 0.010  # a point belongs to a flaw from this deviation on
APART_MM = 0.6  # between the rims of two flaws, and from a rim to an edge of the part
_CELL_MM = 0.1
_STEP_MM = 0.025  # a surface that bends more than this over 0.4 mm counts as an edge
_STEEP = 0.8  # largest slope against the view that flaws are put on
_TRIES = 250


@dataclass(frozen=True, kw_only=True, slots=True)
class Specimen:
    """A flawed part and the scan that sees it.

    Attributes
    ----------
    solid
        Part frame, as its file has it.
    sight
        Commanded scan; the part lies where it says.
    flaws
        Those that were cut; number k + 1 in `instance`.
    instance : (profiles, columns) int16
        Flaw that each ray meets; 0 none, -1 where a ray meets nothing, or a flaw's faint rim
        or shadow, which counts neither way.
    """

    solid: Solid
    sight: Sight
    flaws: tuple[Flaw, ...]
    instance: NDArray[np.int16]


@njit(cache=True)
def _plumb(tree: Tree, x_mm: Floats, y_mm: Floats) -> Floats:
    """First hits of rays along z."""
    z = np.full(x_mm.size, np.nan)
    for i in range(x_mm.size):
        t, which = nearest(tree, (x_mm[i], y_mm[i], 0.0), (0.0, 0.0, 1.0), 1e-3, 1e9, False)
        if which >= 0:
            z[i] = t
    return z


def plumb(tree: Tree, plane_mm: Floats) -> Floats:
    """Depth of the surface along z at points (..., 2) across the view; NaN beside the part."""
    flat = np.ascontiguousarray(plane_mm.reshape(-1, 2), np.float64)
    z = _plumb(tree, np.ascontiguousarray(flat[:, 0]), np.ascontiguousarray(flat[:, 1]))
    return np.asarray(z.reshape(plane_mm.shape[:-1]), np.float64)


def draw_path(
    rng: np.random.Generator, like: Path, distance_mm: float, top_mm: float
) -> Path:
    """Draw a scan over the part's middle: any heading, up to 9 degrees of tilt."""
    face = Rotation.from_euler("x", 180, degrees=True)
    spin = Rotation.from_euler("z", rng.uniform(0, 360), degrees=True)
    lean = Rotation.from_euler("xy", rng.uniform(-9, 9, 2), degrees=True)
    turn = (spin * lean * face).as_matrix()
    aim = np.array([*rng.uniform(-3, 3, 2), top_mm / 2])
    direction = int(rng.choice([-1, 1]))
    middle = direction * like.pitch_mm * (like.profiles - 1) / 2
    start = np.eye(4)
    start[:3, :3] = turn
    start[:3, 3] = aim - turn @ np.array([0.0, middle, distance_mm])
    return replace(like, start=start, direction=direction)


def _smooth(tree: Tree, sight: Sight, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Cells of a grid across the view that are smooth, not steep, lit and seen."""
    x = np.arange(low[0], high[0], _CELL_MM)
    y = np.arange(low[1], high[1], _CELL_MM)
    z = plumb(tree, np.stack(np.meshgrid(x, y, indexing="ij"), -1))
    bad = ~np.isfinite(z)
    for axis in (0, 1):
        ahead, behind = np.roll(z, -2, axis), np.roll(z, 2, axis)
        with np.errstate(invalid="ignore"):
            bad |= ~(np.abs(ahead + behind - 2 * z) < _STEP_MM)
            bad |= ~(np.abs(ahead - behind) < _STEEP * 4 * _CELL_MM)
    bad |= ~sight.seen(tree, x, y, z)
    bad = binary_dilation(bad, iterations=2)
    bad[:3], bad[-3:], bad[:, :3], bad[:, -3:] = True, True, True, True
    return np.asarray(~bad)


def make_specimen(
    clean: Solid, sight: Sight, rng: np.random.Generator, *, each: int = 2
) -> Specimen:
    """Cut flaws of every kind and size into a part, where a scan sees it.

    Parameters
    ----------
    clean
        Part frame.
    each
        Flaws tried of each kind and size; those without room are left out.
    """
    vertices = moved(clean, np.linalg.inv(sight.frame))
    tree = plant(vertices, clean.faces)
    low, high = sight.ends_mm
    free = _smooth(tree, sight, low, high)
    cut: list[Flaw] = []
    places: list[Floats] = []
    cutters: list[manifold3d.Manifold] = []
    wanted = [(kind, size) for kind in KINDS for size in SIZES] * each
    wanted.sort(key=lambda name: -RANGES[name][0][1])  # the longest first, while there is room
    for kind, size in wanted:
        room = distance_transform_edt(free) * _CELL_MM
        for _ in range(_TRIES):
            flaw = draw_flaw(kind, size, rng)
            centre = low + rng.uniform(0, 1, 2) * (high - low)
            track = _filled(flaw) + centre
            cell = np.floor((track - low) / _CELL_MM).astype(int)
            inside = (cell >= 0).all(1) & (cell < free.shape).all(1)
            rim = _rim_mm(flaw) + APART_MM
            if not inside.all() or not (room[cell[:, 0], cell[:, 1]] > rim).all():
                continue
            plane, depth = patch_of(flaw)
            surface = plumb(tree, plane + centre)
            if not np.isfinite(surface).all():
                continue
            rise = 0.7 * flaw.depth_mm + 0.02
            flat = np.asarray(plane + centre)
            try:
                cutters.append(
                    cutter(np.concatenate([flat, (surface + depth)[..., None]], -1),
                           np.concatenate([flat, (surface - rise)[..., None]], -1))
                )  # fmt: skip
            except ValueError:
                continue
            cut.append(flaw)
            places.append(track)
            hit = np.zeros(free.shape, bool)
            hit[cell[:, 0], cell[:, 1]] = True
            free &= distance_transform_edt(~hit) * _CELL_MM > rim
            break
    part = solid_from(vertices, clean.faces)
    tools = manifold3d.Manifold.batch_boolean(cutters, manifold3d.OpType.Add)
    found = solid_of((part - tools).transform(np.asarray(sight.frame[:3], np.float64)))
    instance = _label(clean, found, sight, cut, places)
    return Specimen(solid=found, sight=sight, flaws=tuple(cut), instance=instance)


def _rim_mm(flaw: Flaw) -> float:
    """From the track to the rim."""
    return max(flaw.length_mm, flaw.width_mm) / 2 if flaw.kind in ("dent", "pit") else (
        flaw.half_width_mm
    )


def _filled(flaw: Flaw) -> Floats:
    """Points along the track, at most 0.1 mm apart; the centre of what is round."""
    if flaw.kind in ("dent", "pit"):
        return np.zeros((1, 2))
    at = np.linspace(0, len(flaw.track_mm) - 1, int(flaw.length_mm / 0.08) + 2)
    each = np.arange(len(flaw.track_mm))
    return np.stack([np.interp(at, each, flaw.track_mm[:, k]) for k in (0, 1)], 1)


def _label(
    clean: Solid, found: Solid, sight: Sight, cut: list[Flaw], places: list[Floats]
) -> NDArray[np.int16]:
    before, after = sight.depth(clean), sight.depth(found)
    with np.errstate(invalid="ignore"):
        deviation = after - before
    label = np.where(np.isfinite(before), 0, -1).astype(np.int16)
    label[deviation > 0.001] = -1  # a faint rim counts neither way
    deep = deviation > LABEL_MM
    if deep.any() and cut:
        points = sight.places(before)[deep]
        away = [
            cKDTree(place).query(points)[0] - _rim_mm(flaw)
            for flaw, place in zip(cut, places, strict=True)
        ]
        label[deep] = np.argmin(away, axis=0) + 1
    return label


def write_obj(file: FilePath, solid: Solid) -> None:
    """Write a mesh with its corners shared, in mm."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in solid.vertices_mm]
    lines += [f"f {a} {b} {c}" for a, b, c in solid.faces + 1]
    file.write_text("\n".join(lines) + "\n")
