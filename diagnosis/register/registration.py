"""Registration: where the part really was and where the travel went, a nuisance of nine numbers.

Gauss-Newton on the depth residual with the analytic derivative of depth by pose, robust, with
edges and creases down-weighted; directions that smooth faces leave open are then settled by the
silhouettes, if there are any. The same columns are projected out of every later test.
"""

import numpy as np
from scipy.ndimage import binary_dilation, maximum_filter, minimum_filter

from diagnosis.fields import Field, Mask, median_sd
from diagnosis.register.placement import PRIOR_SD, Placement, move, move_all
from diagnosis.register.pose_derivative import pose_columns, travel_columns
from diagnosis.register.sample import Sample, pitch_of
from diagnosis.register.silhouettes import settled_by_silhouettes
from diagnosis.settings import SETTINGS
from sensors.casting.hits import Hits
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.recording import Recording

MOVE_LIMIT = np.array([1.0, 1.0, 1.0, 0.01, 0.01, 0.01, 1e-3, 5e-3, 5e-3])
"""Largest step of one iteration: mm, radians, share of the travel, its direction."""
ROUNDS, LEAST_ROUNDS, SETTLED = 25, 8, 2e-6
"""Iterations at most and at least, and the step, over the largest, that ends them."""
FIRST_ROUNDS = 3
"""Iterations in which a placement that is off widens the scale."""
FIRST_SD, NARROWER = 6.0, 0.8
"""Deviations at which the first iteration's weights end, and the factor on them for the next."""


def smooth_weight(depth_mm: Field, normal: Field, pitch_mm: float) -> Field:
    """Weight 1 on smooth faces, 0 at depth edges, less by creases and corners; (n, m).

    Works on a grid whose neighbours lie `pitch_mm` apart or more.
    """
    finite = np.isfinite(depth_mm)
    size = (3, 3)
    gap = ~minimum_filter(finite, size, mode="nearest")
    high = maximum_filter(np.where(finite, depth_mm, -np.inf), size, mode="nearest")
    low = minimum_filter(np.where(finite, depth_mm, np.inf), size, mode="nearest")
    jump = np.where(finite, high - low, 0.0) > SETTINGS.register.jump_pitches * pitch_mm
    turned = np.zeros(depth_mm.shape, dtype=bool)
    for axis in (0, 1):
        dot = np.einsum("nmk,nmk->nm", normal, np.roll(normal, 1, axis=axis))
        bent = dot < np.cos(np.radians(SETTINGS.register.crease_deg))
        bent[0 if axis == 0 else slice(None), 0 if axis == 1 else slice(None)] = False
        turned |= bent | np.roll(bent, -1, axis=axis)
    weight = np.ones(depth_mm.shape)
    weight[binary_dilation(turned, iterations=2)] = SETTINGS.register.crease_weight
    weight[binary_dilation(gap | jump, iterations=1) | ~finite] = 0.0
    return weight


def register(
    scene: Scene,
    recording: Recording,
    laser: Laser,
    *,
    datasheet: Datasheet,
    valid: Mask,
    offset_mm: Field | None = None,
    sd_mm: float = 0.0,
    spread: Field | None = None,
) -> Placement:
    """Fit the placement of one recording.

    Parameters
    ----------
    datasheet : Datasheet
        Where the camera is, if stated.
    valid : (n, m) bool
        Readings to use.
    offset_mm : (n, m), optional
        What the model expects beyond the geometric depth, mm.
    sd_mm : float
        Noise of a reading where known; guards the robust scale against zero.
    spread : (n, m), optional
        What each reading's noise is larger or smaller by.

    Raises
    ------
    RecipeError
        Where the recording and the part don't overlap or are of different units.
    """
    sample = Sample.of(
        scene, recording, laser, valid=valid, offset_mm=offset_mm, spread=spread
    )
    points, together = sample.met(recording.name)
    centre = points.mean(axis=0)
    pitch = pitch_of(points, together.shape)
    shift, covariance = _by_smooth_faces(sample, centre, pitch, sd_mm)
    shift = settled_by_silhouettes(
        sample, shift, covariance, centre=centre, pitch=pitch, sd_mm=sd_mm, datasheet=datasheet
    )
    return Placement(
        shift=shift,
        centre_mm=centre,
        covariance=covariance,
        poses=move_all(recording.poses, sample.poses, shift, centre),
    )


def _by_smooth_faces(
    sample: Sample, centre: Field, pitch: float, sd_mm: float
) -> tuple[Field, Field]:
    """Fit a shift (9,) by Gauss-Newton, robustly, with its covariance (9, 9)."""
    scene, rays, poses, depth = sample.scene, sample.rays, sample.poses, sample.depth_mm
    shift = np.zeros(PRIOR_SD.size)
    inverse_prior = np.diag(PRIOR_SD**-2.0)
    covariance = np.diag(PRIOR_SD**2)
    tune = FIRST_SD
    for step in range(ROUNDS):
        moved = move(poses, shift, centre)
        hits = scene.cast(rays, moved)
        normal = scene.normals[hits.triangle]
        weight = smooth_weight(hits.depth_mm, normal, pitch)
        use = (weight > 0) & np.isfinite(depth)
        if use.sum() < SETTINGS.register.least_readings:
            break
        residual = (depth - hits.depth_mm)[use] / sample.spread[use]
        scale = max(median_sd(residual - np.median(residual)), sd_mm, 1e-5)
        if step < FIRST_ROUNDS:
            scale = max(scale, median_sd(residual))
        tune = max(SETTINGS.register.bisquare_sd, tune * NARROWER)
        robust = (1 - np.clip(residual / (tune * scale), -1, 1) ** 2) ** 2
        columns = pose_columns(
            moved, rays, hits.depth_mm, normal, centre, travel_columns(moved)
        )[use]
        columns /= sample.spread[use][:, None]
        factor = weight[use] * robust / scale**2
        normal_matrix = (columns * factor[:, None]).T @ columns
        # neighbours share noise: so many readings count as one against the prior
        hessian = normal_matrix / SETTINGS.register.together + inverse_prior
        gradient = (columns * factor[:, None]).T @ residual / SETTINGS.register.together
        gradient -= inverse_prior @ shift
        change = np.linalg.solve(hessian, gradient)
        covariance = np.linalg.inv(hessian)
        largest = np.max(np.abs(change) / MOVE_LIMIT)
        shift = shift + change / max(largest, 1.0)
        if largest < SETTLED and step + 1 >= LEAST_ROUNDS:
            break
    return shift, covariance


def hits_normal(scene: Scene, hits: Hits) -> Field:
    """Outward normals at the hits, part frame, (n, m, 3)."""
    return np.asarray(scene.normals[hits.triangle])
