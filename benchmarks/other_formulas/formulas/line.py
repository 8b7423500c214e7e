"""The line's width at work: footprints, two levels at an edge, brightness, shadows."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.other_formulas.formulas.base import Formula, shared
from benchmarks.other_formulas.shot import Shot, View

Floats = NDArray[np.float64]
_LEVELS_MM = 0.4  # depths further apart than this are two levels


def _footprint(shot: Shot, places: Floats, weight: Floats) -> Shot:
    """Average over a footprint (k, 2) around each reading; of two levels the brighter counts."""
    seen = np.stack([shot.view.cast(float(dx), float(dy)) for dx, dy in places])
    own = shot.view.depth
    with np.errstate(invalid="ignore"):
        near = np.abs(seen - own) < _LEVELS_MM
        w = weight[:, None, None] * near
        mean = np.nansum(w * np.nan_to_num(seen - own), 0) / w.sum(0)
    return shot.plus(np.where(np.isfinite(own), np.nan_to_num(mean), 0.0))


def disc(shot: Shot, size: float, _seed: int) -> Shot:
    """Footprint as an even disc of radius 0.25 mm times size."""
    r = np.repeat(np.sqrt([0.15, 0.5, 0.85]), 8)
    a = np.tile(np.arange(8), 3) * np.pi / 4 + np.repeat([0.0, 0.4, 0.0], 8)
    places = 0.25 * size * np.stack([r * np.cos(a), r * np.sin(a)], 1)
    return _footprint(shot, places, np.ones(24))


def halo(shot: Shot, size: float, _seed: int) -> Shot:
    """Footprint with a halo: a double exponential, longer along the travel."""
    u = np.linspace(-2.5, 2.5, 5)
    x, y = np.meshgrid(u, u)
    places = size * np.stack([0.10 * x.ravel(), 0.14 * y.ravel()], 1)
    return _footprint(shot, places, np.exp(-np.abs(x) - np.abs(y)).ravel())


def line_reads(
    view: View, eta: Floats, light: Floats, bright: Floats | float = 1.0
) -> Floats:
    """Centre of gravity of a line of light over displacements eta along the travel, mm.

    Each place on the line reads its own depth plus κ η cot θ; bright (k, n, m) weighs it.
    """
    total, moment = np.zeros(view.shape), np.zeros(view.shape)
    for k, (offset, strength) in enumerate(zip(eta, light, strict=True)):
        seen = view.cast(dy=float(offset))
        w = strength * (bright[k] if isinstance(bright, np.ndarray) else bright)
        w = w * np.isfinite(seen)
        total += w
        moment += w * (np.nan_to_num(seen - view.depth) + offset * view.cot)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(moment / total)


def _mixed(shot: Shot, eta: Floats, light: Floats) -> Shot:
    """Merge the levels of an edge; away from edges the reading is left as it is."""
    reads = line_reads(shot.view, eta, light)
    return shot.plus(np.where(shot.view.edge, np.nan_to_num(reads), 0.0))


def flat_top_mixing(shot: Shot, size: float, _seed: int) -> Shot:
    """Edge mixing of a flat-topped line, 0.4 mm wide times size."""
    return _mixed(shot, 0.2 * size * np.linspace(-1, 1, 11), np.ones(11))


def sech_mixing(shot: Shot, size: float, _seed: int) -> Shot:
    """Edge mixing of a line with wide wings, sech²."""
    u = np.linspace(-3, 3, 13)
    return _mixed(shot, 0.08 * size * u, 1 / np.cosh(u) ** 2)


def _albedo(points: Floats, seed: int, dots: bool) -> Floats:
    """Brightness printed on the part: a checkerboard of soft squares, or round dots."""
    rng = shared(seed, 5)
    period, turn = float(rng.uniform(5, 8)), float(rng.uniform(0.2, 1.2))
    dark = float(rng.uniform(0.15, 0.3))
    x, y = points[..., 0], points[..., 1]
    u, v = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    if dots:
        far = np.hypot(*(np.mod(w / period, 1.0) - 0.5 for w in (u, v)))
        return np.where(far < 0.3, dark, 0.85)
    return np.where(np.sin(2 * np.pi * u / period) * np.sin(2 * np.pi * v / period) > 0, 0.85, dark)


def _printed(shot: Shot, eta: Floats, light: Floats, seed: int, dots: bool) -> Shot:
    pose = shot.view.scan.true_poses
    along = pose[:, None, :3, 1]
    bright = np.stack([_albedo(shot.view.points + e * along, seed, dots) for e in eta])
    plain_line = line_reads(shot.view, eta, light)
    change = line_reads(shot.view, eta, light, bright) - plain_line
    seen = np.einsum("k,knm->nm", light / light.sum(), bright) * np.cos(shot.view.incidence)
    speckled = seen * (1 + 0.08 * shared(seed, 9, shot.index).standard_normal(seen.shape))
    smooth = np.where(shot.view.edge, 0.0, np.nan_to_num(change))
    return replace(shot.plus(smooth), intensity=np.clip(speckled, 0, 1))


def checks(shot: Shot, size: float, seed: int) -> Shot:
    """Print a checkerboard, seen by a flat-topped line."""
    return _printed(shot, 0.15 * size * np.linspace(-1, 1, 9), np.ones(9), seed, dots=False)


def dots(shot: Shot, size: float, seed: int) -> Shot:
    """Print dots, seen by a line of two lobes."""
    u = np.linspace(-2, 2, 11)
    return _printed(shot, 0.08 * size * u, u**2 * np.exp(-(u**2)), seed, dots=True)


def _blocked(view: View, target: Floats) -> NDArray[np.bool_]:
    pose = view.scan.true_poses
    towards = pose[:, :3, :3] @ target + pose[:, :3, 3]
    points = view.points + 1e-3 * np.einsum("nij,nmj->nmi", pose[:, :3, :3], view.normal)
    ends = np.broadcast_to(towards[:, None], points.shape)
    seen = np.isfinite(view.depth)
    out = np.zeros(view.shape, bool)
    out[seen] = view.scene.blocked(points[seen], ends[seen])
    return out


def lens_shadow(shot: Shot, size: float, _seed: int) -> Shot:
    """Shadow of a lens of finite size: lost where most of five rays to its pupil are stopped."""
    view = shot.view
    base = np.array([0.0, view.camera_y_mm * min(size, 1.5), 0.0])
    pupil = ([0, 0, 0], [4, 0, 0], [-4, 0, 0], [0, 4, 0], [0, -4, 0])
    share = np.mean([_blocked(view, base + np.array(p)) for p in pupil], axis=0)
    return replace(shot, p_missing=np.maximum(shot.p_missing, np.clip(2 * share - 0.3, 0, 0.998)))


def horizon_shadow(shot: Shot, size: float, _seed: int) -> Shot:
    """Shadow by the horizon of a far camera: parallel sight lines, over the delivered grid."""
    view = shot.view
    steep = abs(view.camera_y_mm) / view.instrument.sheet.working_distance_mm * min(size, 1.5)
    side = int(np.sign(view.camera_y_mm))
    depth, hidden = view.depth, np.zeros(view.shape, bool)
    for k in range(1, 40):
        dy = 0.1 * k
        with np.errstate(invalid="ignore"):
            hidden |= view.cast(dy=side * dy) < depth - dy / steep
    return replace(shot, p_missing=np.where(hidden, 0.998, shot.p_missing))


FORMULAS = (
    Formula(name="disc footprint", effect="finite_spot", apply=disc,
            parts=("grooves", "ribs", "terraces", "roof")),
    Formula(name="halo footprint", effect="finite_spot", apply=halo,
            parts=("grooves", "ribs", "terraces", "roof")),
    Formula(name="flat-topped line", effect="edge_mixing", apply=flat_top_mixing,
            parts=("terraces", "ribs")),
    Formula(name="sech² line", effect="edge_mixing", apply=sech_mixing, parts=("terraces", "ribs")),
    Formula(name="checks", effect="reflectance_edge", apply=checks),
    Formula(name="dots", effect="reflectance_edge", apply=dots),
    Formula(name="pupil's shadow", effect="camera_occlusion", apply=lens_shadow,
            parts=("terraces", "ribs"), scaled=False),
    Formula(name="far camera's horizon", effect="camera_occlusion", apply=horizon_shadow,
            parts=("terraces", "ribs"), scaled=False),
)  # fmt: skip
