"""Silhouettes: where a part's faces end settles what smooth faces leave open of a placement."""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.optimize import minimize

from diagnosis.fields import Field
from diagnosis.noise.noise_model import robust_sd
from diagnosis.predict.cameras import possible_sheets
from diagnosis.register.coordinate_search import step_by_step
from diagnosis.register.placement import PRIOR_SD, move
from diagnosis.register.pose_derivative import travel_vector
from diagnosis.register.sample import Sample
from diagnosis.settings import SETTINGS
from sensors.casting.laser import Laser
from sensors.datasheet import Datasheet
from sensors.view.covariates import CAMERA
from sensors.view.visibility import camera_visible

REACHES = (8.0, 3.0, 1.0, 0.4, 0.15, 0.05)
"""Steps of a search by silhouettes, in pitches."""


def settled_by_silhouettes(
    sample: Sample,
    start: Field,
    covariance: Field,
    *,
    centre: Field,
    pitch: float,
    sd_mm: float,
    datasheet: Datasheet,
) -> Field:
    """Let silhouettes, if there are any, settle what smooth faces leave open of a shift (9,).

    They do where the readings prefer one place clearly: first where the part lies, then how the
    sensor travels. At once, both ends of a bar would stretch the travel to make up for a part that
    lies elsewhere.

    Parameters
    ----------
    start, covariance : (9,), (9, 9), by smooth faces
    """
    scene, rays, poses, depth = sample.scene, sample.rays, sample.poses, sample.depth_mm
    opened = [
        open_directions(covariance, poses, rays, depth, pitch, travels=travels)
        for travels in (False, True)
    ]
    if not len(opened[1]):
        return start
    hits = scene.cast(rays, moved := move(poses, start, centre))
    if not any_silhouette(hits.depth_mm, pitch):
        return start
    known = np.isfinite(depth)
    if datasheet.triangulation_angle_deg is not None:
        # what is read in a shadow is read elsewhere: it would draw the edge there
        for sheet in possible_sheets(datasheet, CAMERA):
            seen = camera_visible(scene, rays, moved, hits, sheet.camera_offset_mm)
            hidden = np.isfinite(hits.depth_mm) & ~seen
            known &= ~binary_dilation(hidden, iterations=SETTINGS.register.shadow_pitches)
    away = (depth - hits.depth_mm)[known & np.isfinite(hits.depth_mm)]
    # faces that are bent don't tell where they end
    cap = max(10 * sd_mm, SETTINGS.register.silhouette_pitches * pitch, 2 * robust_sd(away))

    def cost(shift: Field) -> float:
        hits = scene.cast(rays, move(poses, shift, centre))
        seen = np.isfinite(hits.depth_mm)
        both = known & seen
        gap = np.clip((depth - hits.depth_mm)[both] / cap, -1, 1)
        wrong = float((gap**2).sum() + (known & ~seen).sum())
        prior = float((shift / PRIOR_SD) @ (shift / PRIOR_SD))
        return wrong + 0.5 * prior

    for directions in opened:
        start = _searched(cost, start, directions, pitch)
    return start


def _searched(
    cost: Callable[[Field], float], start: Field, directions: Field, pitch: float
) -> Field:
    """Follow a piecewise cost along directions where that saves enough."""
    if not len(directions):
        return start

    def there(steps: Field) -> float:
        return cost(start + steps @ directions)

    best, gained = step_by_step(there, len(directions), [k * pitch for k in REACHES])
    if gained < SETTINGS.register.least_settled:
        return start
    polished = minimize(
        there,
        best,
        method="Nelder-Mead",
        options={
            "initial_simplex": best
            + 0.05 * pitch * np.vstack([np.zeros(len(best)), np.eye(len(best))]),
            "maxfev": 30 * len(best),
            "xatol": 1e-3 * pitch,
            "fatol": 0.01,
        },
    )
    return np.asarray(start + polished.x @ directions)


def any_silhouette(depth_mm: Field, pitch_mm: float) -> bool:
    """Whether depth (n, m) ends, or leaves the line through its neighbours, anywhere."""
    bends = [np.abs(np.diff(depth_mm, n=2, axis=axis)) for axis in (0, 1)]
    least_mm = SETTINGS.register.silhouette_pitches * pitch_mm
    steps = any((bend > least_mm).any() for bend in bends)
    return bool(steps or not np.isfinite(depth_mm).all())


def open_directions(
    covariance: Field,
    poses: Field,
    rays: Laser,
    depth_mm: Field,
    pitch_mm: float,
    *,
    travels: bool = True,
) -> Field:
    """Directions (k, 9) in which smooth faces leave a placement open; a unit moves it by 1 mm.

    Planes say nothing of where they end: walls and what is read between two levels do, and those
    may be blurred over many pitches.

    Parameters
    ----------
    travels : whether the travel may be another; else where the part lies, for a travel as it is
    """
    sizes = np.array(
        [1.0, 1.0, 1.0, *(1 / _reach(poses, rays, depth_mm),) * 3, *(1 / _length(poses),) * 3]
    )
    if not travels:
        covariance, sizes = np.linalg.inv(np.linalg.inv(covariance)[:6, :6]), sizes[:6]
    values, vectors = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    left_open = np.sqrt(values) > SETTINGS.register.open_pitches * pitch_mm
    found = (vectors[:, left_open] * sizes[:, None]).T
    return np.hstack([found, np.zeros((len(found), 9 - len(sizes)))])


def _reach(poses: Field, rays: Laser, depth: Field) -> float:
    points = rays.points_part_mm(depth, poses)[np.isfinite(depth)]
    spread = points.max(axis=0) - points.min(axis=0)
    return max(0.5 * float(np.sqrt((spread**2).sum())), 1e-3)


def _length(poses: Field) -> float:
    return float(max(np.linalg.norm(travel_vector(poses), axis=1).max(), 1e-3))
