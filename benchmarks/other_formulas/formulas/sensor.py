"""Errors of the sensor's own coordinates: rows, columns, lens, scale, mounting."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.other_formulas.formulas.base import Formula, shared
from benchmarks.other_formulas.shot import Shot, View

Floats = NDArray[np.float64]


def camera_row(view: View, rng: np.random.Generator) -> Floats:
    """Row of the line's image on a flat chip normal to the camera's axis.

    Thin lens: tan of the angle from the axis times the focal length over the row's pitch. The
    pitch in depth is drawn, 0.25 to 0.6 mm.
    """
    sheet = view.instrument.sheet
    theta = np.radians(sheet.triangulation_angle_deg or 30.0)
    base = sheet.working_distance_mm * np.tan(theta)
    pitch = float(rng.uniform(0.25, 0.6))
    angle = np.arctan2(base, np.nan_to_num(view.depth, nan=sheet.working_distance_mm)) - theta
    gain = sheet.working_distance_mm / (np.cos(theta) * np.sin(theta)) / pitch
    return np.asarray(gain * np.tan(angle) + rng.uniform())


def sawtooth_rows(shot: Shot, size: float, seed: int) -> Shot:
    """Locking as a sawtooth: the finder is drawn towards the nearest row, and lets go."""
    v = camera_row(shot.view, shared(seed))
    return shot.plus(0.02 * size * (np.mod(v, 1.0) - 0.5))


def triangle_rows(shot: Shot, size: float, seed: int) -> Shot:
    """Locking as an uneven triangle wave: up over 0.3 of a row, down over the rest."""
    u = np.mod(camera_row(shot.view, shared(seed)), 1.0)
    return shot.plus(0.02 * size * (np.where(u < 0.3, u / 0.3, (1 - u) / 0.7) - 0.5))


def arc_bow(shot: Shot, size: float, seed: int) -> Shot:
    """Line bowed as an arc of a circle: R - sqrt(R² - x²), R 1.1 half lines."""
    half = shot.view.instrument.sheet.x_fov_mm / 2
    radius, sign = 1.1 * half, shared(seed).choice([-1, 1])
    x = np.clip(shot.view.x, -1.05 * half, 1.05 * half)
    sag = radius - np.sqrt(radius**2 - x**2)
    return shot.plus(0.02 * sign * size * sag / radius)


def catenary_bow(shot: Shot, size: float, seed: int) -> Shot:
    """Line bowed as a hanging chain, cosh(2 x / half line) - 1."""
    half = shot.view.instrument.sheet.x_fov_mm / 2
    sign = shared(seed).choice([-1, 1])
    return shot.plus(0.005 * sign * size * (np.cosh(2 * shot.view.x / half) - 1))


def division_lens(shot: Shot, size: float, seed: int) -> Shot:
    """Lens by the division model (Fitzgibbon 2001): x / (1 - k x²) - x, its odd depth error."""
    u = 2 * shot.view.x / shot.view.instrument.sheet.x_fov_mm
    sign = shared(seed).choice([-1, 1])
    return shot.plus(0.03 * sign * size * (u / (1 - 0.45 * u**2) - u))


def twisted_lens(shot: Shot, size: float, seed: int) -> Shot:
    """Keystone that saturates: tanh over the range times a sine along the line."""
    sheet, sign = shot.view.instrument.sheet, shared(seed).choice([-1, 1])
    over = np.nan_to_num(shot.view.depth, nan=sheet.working_distance_mm) - sheet.working_distance_mm
    return shot.plus(
        0.03 * sign * size * np.tanh(over / 3.0) * np.sin(2.4 * shot.view.x / sheet.x_fov_mm)
    )


def quadratic_scale(shot: Shot, size: float, seed: int) -> Shot:
    """Scale error that grows over the range: e (z - z0) (1 + (z - z0) / 12 mm)."""
    over = shot.view.depth - shot.view.instrument.sheet.working_distance_mm
    return shot.plus(2e-3 * shared(seed).choice([-1, 1]) * size * over * (1 + over / 12.0))


def log_scale(shot: Shot, size: float, seed: int) -> Shot:
    """Scale error by the logarithm of the distance from a wrong centre, 60 mm nearer."""
    z, z0 = shot.view.depth, shot.view.instrument.sheet.working_distance_mm
    return shot.plus(0.1 * shared(seed).choice([-1, 1]) * size * np.log((z - z0 + 30.0) / 30.0))


def telegraph_columns(shot: Shot, size: float, seed: int) -> Shot:
    """Columns of blocks: two levels, each kept for a geometric number of columns."""
    rng, m = shared(seed), shot.view.shape[1]
    level = np.cumsum(rng.random(m) < 0.15) % 2 * 2.0 - 1.0
    return shot.plus(0.004 * size * np.broadcast_to(level, shot.view.shape))


def laplace_columns(shot: Shot, size: float, seed: int) -> Shot:
    """Columns each for itself, Laplace-distributed: few large ones."""
    level = shared(seed).laplace(0, 1, shot.view.shape[1])
    return shot.plus(0.003 * size * np.broadcast_to(level, shot.view.shape))


def _aside(shot: Shot, shift_mm: Floats) -> Shot:
    """Look with each column beside where the file says, shift_mm (m,) along the line."""
    laser = shot.view.laser
    moved = replace(laser, x_mm=laser.x_mm + shift_mm)
    there = replace(shot.view, rays=moved).depth
    return replace(shot, mean=shot.mean + there - shot.view.depth)


def _line(shot: Shot) -> Floats:
    """Place along the line at the working distance, -1 to 1."""
    return np.linspace(-1, 1, shot.view.shape[1])


def sine_places(shot: Shot, size: float, seed: int) -> Shot:
    """Places along the line off by a sine, as of a lens between two elements."""
    return _aside(shot, 0.1 * size * shared(seed).choice([-1, 1]) * np.sin(np.pi * _line(shot)))


def square_places(shot: Shot, size: float, seed: int) -> Shot:
    """Magnification that grows outwards: places off by u |u|."""
    u = _line(shot)
    return _aside(shot, 0.1 * size * shared(seed).choice([-1, 1]) * u * np.abs(u))


def vignette(shot: Shot, size: float, _seed: int) -> Shot:
    """Noise by the fourth power of the cosine of a wide lens's field angle."""
    angle = 0.7 * _line(shot)
    return replace(shot, scale=shot.scale * np.cos(angle) ** (-4 * size))


def tent(shot: Shot, size: float, _seed: int) -> Shot:
    """Light that falls off linearly from the middle: noise by 1 + |u|."""
    return replace(shot, scale=shot.scale * (1 + 0.6 * size * np.abs(_line(shot))))


def mounted(shot: Shot, wrong: Floats) -> Shot:
    """Move the sensor by (4, 4) in its own frame; formulas on top keep the exact geometry."""
    moved = shot.view.seen_from(shot.view.scan.true_poses @ wrong)
    return replace(shot, mean=shot.mean + moved - shot.view.depth, mounting=wrong)


def flange(shot: Shot, size: float, seed: int) -> Shot:
    """Mounting turned about the flange, 120 mm behind the sensor: turn and shift together."""
    rng, wrong = shared(seed), np.eye(4)
    axis = rng.normal(size=3)
    turn = Rotation.from_rotvec(3e-3 * size * axis / np.linalg.norm(axis)).as_matrix()
    lever = np.array([0.0, 0.0, 120.0])
    wrong[:3, :3], wrong[:3, 3] = turn, turn @ lever - lever
    return mounted(shot, wrong)


def shimmed(shot: Shot, size: float, seed: int) -> Shot:
    """One of three mounting feet on a shim: tilt about the line of the other two."""
    rng, wrong = shared(seed), np.eye(4)
    a = rng.uniform(0, 2 * np.pi)
    axis = np.array([np.cos(a), np.sin(a), 0.0])
    wrong[:3, :3] = Rotation.from_rotvec(3e-3 * size * axis).as_matrix()
    wrong[:3, 3] = [0.0, 0.0, 0.1 * size]
    return mounted(shot, wrong)


FORMULAS = (
    Formula(name="sawtooth rows", effect="pixel_locking", apply=sawtooth_rows),
    Formula(name="triangle rows", effect="pixel_locking", apply=triangle_rows),
    Formula(name="arc", effect="line_bow", apply=arc_bow),
    Formula(name="catenary", effect="line_bow", apply=catenary_bow),
    Formula(name="division lens", effect="lens_distortion", apply=division_lens),
    Formula(name="twisted lens", effect="lens_distortion", apply=twisted_lens),
    Formula(name="quadratic scale", effect="range_scale", apply=quadratic_scale),
    Formula(name="logarithmic scale", effect="range_scale", apply=log_scale),
    Formula(name="telegraph columns", effect="column_offset", apply=telegraph_columns),
    Formula(name="Laplace columns", effect="column_offset", apply=laplace_columns),
    Formula(name="sine of place", effect="lateral_error", apply=sine_places),
    Formula(name="square of place", effect="lateral_error", apply=square_places),
    Formula(name="vignette", effect="light_falloff", apply=vignette),
    Formula(name="tent of light", effect="light_falloff", apply=tent),
    Formula(name="turned flange", effect="pose_error", apply=flange),
    Formula(name="shimmed foot", effect="pose_error", apply=shimmed),
)
