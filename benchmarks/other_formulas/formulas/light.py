"""Light and surface: lobes, translucency, second bounces, bias and noise with slope."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.other_formulas.formulas.base import Formula, shared
from benchmarks.other_formulas.shot import Shot, View

Floats = NDArray[np.float64]


def tanh_bias(shot: Shot, size: float, seed: int) -> Shot:
    """Bias with the signed slope along the travel that saturates: tanh(p / 0.3)."""
    sign = shared(seed).choice([-1, 1])
    return shot.plus(0.008 * sign * size * np.tanh(shot.view.slope_y / 0.3))


def exponential_bias(shot: Shot, size: float, seed: int) -> Shot:
    """Bias one-sided in the slope along the travel: exp(p / 0.35) - 1."""
    sign = shared(seed).choice([-1, 1])
    p = np.clip(sign * shot.view.slope_y, -1.5, 1.2)
    return shot.plus(0.006 * size * (np.exp(p / 0.35) - 1))


def refracted(shot: Shot, size: float, _seed: int) -> Shot:
    """Light from one depth under the surface, seen through it: the cosine of Snell's angle."""
    inside = np.arcsin(np.sin(shot.view.incidence) / 1.45)
    return shot.plus(0.2 * size * np.cos(inside))


def diffusing(shot: Shot, size: float, _seed: int) -> Shot:
    """Diffusing light: depth by the square of the cosine (a slab lit aslant)."""
    return shot.plus(0.05 * size * np.cos(shot.view.incidence) ** 2)


def exponential_noise(shot: Shot, size: float, _seed: int) -> Shot:
    """Noise growing exponentially with the slope's size."""
    tan = np.clip(np.tan(shot.view.incidence), 0, 2.5)
    return replace(shot, scale=shot.scale * np.exp(0.4 * size * tan))


def quartic_noise(shot: Shot, size: float, _seed: int) -> Shot:
    """Noise flat up to a knee, then with the fourth power of the angle."""
    angle = np.minimum(shot.view.incidence, 1)
    return replace(shot, scale=shot.scale * (1 + 6.0 * size * angle**4))


def half_angle(view: View) -> Floats:
    """Angle between the normal and the half vector of laser and camera, rad."""
    ray = np.stack([view.laser.slope_x, 0 * view.laser.slope_x, 1 + 0 * view.laser.slope_x], -1)
    half = view.to_camera - ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    return np.arccos(np.clip((half * view.normal).sum(-1), 0, 1))


def _dark(shot: Shot, lobe: Floats, size: float) -> Shot:
    """Lose readings whose light is below the threshold, softly: size moves the threshold."""
    light = lobe / np.nanmax(lobe) + 0.02
    lost = 1 / (1 + (light / (0.05 * size)) ** 4)
    return replace(shot, p_missing=np.clip(np.maximum(shot.p_missing, lost), 0, 0.99))


def beckmann(shot: Shot, size: float, _seed: int) -> Shot:
    """Specular lobe of Beckmann and Spizzichino, slope 0.25."""
    a = np.minimum(half_angle(shot.view), 1.5)
    return _dark(shot, np.exp(-((np.tan(a) / 0.25) ** 2)) / np.cos(a) ** 4, size)


def ggx(shot: Shot, size: float, _seed: int) -> Shot:
    """Specular lobe of Trowbridge and Reitz (GGX), width 0.18: longer tails."""
    c2 = np.cos(half_angle(shot.view)) ** 2
    return _dark(shot, 1 / (c2 * (0.18**2 - 1) + 1) ** 2, size)


def facing_wall(view: View, reach_mm: float) -> tuple[Floats, Floats]:
    """Where the camera sees light again that a mirror sent on to a facing wall.

    The spot on the wall lies beside the laser's plane; the camera reads it where its line of sight
    meets the plane, in the column that lies there.

    Returns
    -------
    distance : (n, m) mm, way to the wall of the nearest second spot in a reading's column, inf
        where there is none within reach
    ghost : change of depth if all light came from that spot, mm
    """
    ray = np.stack([view.laser.slope_x, 0 * view.laser.slope_x, 1 + 0 * view.laser.slope_x], -1)
    ray = np.broadcast_to(ray / np.linalg.norm(ray, axis=-1, keepdims=True), view.normal.shape)
    mirrored = ray - 2 * (ray * view.normal).sum(-1, keepdims=True) * view.normal
    frame = view.scan.true_poses[:, :3, :3]
    start = view.points + 1e-2 * np.einsum("nij,nmj->nmi", frame, view.normal)
    way = np.einsum("nij,nmj->nmi", frame, mirrored)
    seen = np.isfinite(view.depth)
    found, triangle = view.scene.first_hit(start[seen], way[seen])
    near = np.isfinite(found) & (found < reach_mm)
    profile, column = (i[near] for i in np.nonzero(seen))
    found, out = found[near], mirrored[profile, column]
    first = np.stack([view.x, 0 * view.x, np.nan_to_num(view.depth)], -1)[profile, column]
    second = first + found[:, None] * out
    to_camera = np.array([0.0, view.camera_y_mm, 0.0]) - second
    facing = np.einsum("kji,kj->ki", frame[profile], view.scene.normals[triangle[near]])
    lit = (facing * to_camera).sum(-1) > 0
    x, y, z = second[lit].T
    x, z = x / (1 - y / view.camera_y_mm), z / (1 - y / view.camera_y_mm)
    x_of = view.laser.x_mm + z[:, None] * view.laser.slope_x
    off = np.abs(x_of - x[:, None])
    held, pitch = off.argmin(axis=1), float(np.abs(np.diff(x_of[:1])).mean()) if len(x_of) else 0.0
    inside = off.min(axis=1, initial=np.inf) < pitch
    distance, ghost = np.full(view.shape, np.inf), np.zeros(view.shape)
    for k in np.flatnonzero(inside)[np.argsort(-found[lit][inside], kind="stable")]:
        at = profile[lit][k], held[k]
        distance[at], ghost[at] = found[lit][k], z[k] - view.depth[at]
    return distance, np.nan_to_num(ghost)


def decaying_bounce(shot: Shot, size: float, _seed: int) -> Shot:
    """Second bounce that decays exponentially with the distance to the facing wall."""
    far, ghost = facing_wall(shot.view, 8.0)
    weight = np.where(np.isfinite(far), np.minimum(0.15 * size, 0.8) * np.exp(-far / 2.0), 0.0)
    return shot.plus(weight * np.clip(ghost, -2, 2))


def rational_bounce(shot: Shot, size: float, _seed: int) -> Shot:
    """Second bounce by the solid angle of a strip: 1 / (1 + (d / 1.5 mm)²)."""
    far, ghost = facing_wall(shot.view, 8.0)
    weight = np.where(np.isfinite(far), min(0.15 * size, 0.8) / (1 + (far / 1.5) ** 2), 0.0)
    return shot.plus(weight * np.clip(ghost, -2, 2))


FORMULAS = (
    Formula(name="tanh of slope", effect="incidence_bias", apply=tanh_bias,
            parts=("hills", "freeform", "barrel")),
    Formula(name="exponential of slope", effect="incidence_bias", apply=exponential_bias,
            parts=("hills", "freeform", "barrel")),
    Formula(name="refracted depth", effect="volume_scattering", apply=refracted,
            parts=("hills", "freeform", "barrel", "grooves"), also=("incidence_bias",)),
    Formula(name="diffusing slab", effect="volume_scattering", apply=diffusing,
            parts=("hills", "freeform", "barrel", "grooves"), also=("incidence_bias",)),
    Formula(name="exponential in slope", effect="incidence_noise", apply=exponential_noise,
            parts=("hills", "freeform", "barrel", "grooves")),
    Formula(name="fourth power", effect="incidence_noise", apply=quartic_noise,
            parts=("hills", "freeform", "barrel", "grooves")),
    Formula(name="Beckmann lobe", effect="specular_dropout", apply=beckmann,
            parts=("hills", "freeform", "barrel", "grooves")),
    Formula(name="GGX lobe", effect="specular_dropout", apply=ggx,
            parts=("hills", "freeform", "barrel", "grooves")),
    Formula(name="decaying bounce", effect="interreflection", apply=decaying_bounce,
            parts=("grooves",)),
    Formula(name="rational bounce", effect="interreflection", apply=rational_bounce,
            parts=("grooves",)),
)  # fmt: skip
