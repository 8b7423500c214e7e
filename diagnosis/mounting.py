"""The mounting: whether the recordings' placements agree in the sensor's own frame.

Every other test takes a recording's rigid misplacement as a nuisance. Where the corrections of
several recordings agree in the sensor's frame, far better than they scatter, it isn't the part that
lay wrong each time but the sensor that sits wrong: pose_error.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from diagnosis.noise import Field
from diagnosis.registration import PRIOR_SD, Placement, travel_columns
from sensors.effects.pose_error import PoseError

LEVEL = 1e-3
LEAST = np.array([0.02, 0.02, 0.02, 0.04, 0.04, 0.04])
"""Smallest turns (degrees) and offsets (mm) that are worth telling."""
SLACK = np.array([0.01, 0.01, 0.01, 0.01, 0.01, 0.02])
"""What registration alone scatters: turns in degrees, offsets in mm."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Mounting:
    """A common error of the mounting with its intervals."""

    effect: PoseError
    intervals: dict[str, tuple[float, float, float]]
    z: float


NAMES = ("yaw_deg", "roll_deg", "pitch_deg", "x_mm", "y_mm", "z_mm")


def mounting_error(
    commanded: Sequence[Field], placements: Sequence[Placement], *, travel_mm: float = 0.0
) -> Mounting | None:
    """Find a mounting error that recordings in different orientations share; None without one.

    With one recording, or all in one orientation, sensor and part can't be told apart.

    Parameters
    ----------
    travel_mm : how far along the travel a reading may lie from its stated pose
    """
    if len(placements) < 2 or _spread_deg(commanded) < 15:
        return None
    errors = np.stack([_in_sensor(p, q) for p, q in zip(commanded, placements, strict=True)])
    covariances = np.stack([_uncertainty(p, q) for p, q in zip(commanded, placements, strict=True)])
    covariances[:, 4, 4] += travel_mm**2
    mean, shared, dof = _agreed(errors, covariances)
    tail = float(stats.f.sf(mean @ np.linalg.solve(shared, mean) / 6, 6, dof))
    # how a part lies differs from time to time, in some directions more than in others
    mean, shared, dof = _agreed(errors, covariances + np.diag(errors.var(axis=0, ddof=1)))
    reach = float(stats.t.ppf(0.975, dof))
    sd = np.sqrt(np.diag(shared))
    certain = _certain(shared * reach**2, mean)
    if tail > LEVEL or not (np.abs(certain) > LEAST).any():
        return None
    bounds = {p.name: (p.low, p.high) for p in PoseError.parameters()}
    values = {n: float(np.clip(v, *bounds[n])) for n, v in zip(NAMES, certain, strict=True) if v}
    effect = PoseError.none().with_parameters(values)
    return Mounting(
        effect=effect,
        intervals={
            n: (float(v), float(v - reach * s), float(v + reach * s))
            for n, v, s in zip(NAMES, mean, sd, strict=True)
        },
        z=float(stats.norm.isf(max(tail, 1e-300))),
    )


def _agreed(errors: Field, covariances: Field) -> tuple[Field, Field, int]:
    """Mean (6,) of the errors, its covariance by their scatter, and its degrees of freedom."""
    weights = np.linalg.inv(covariances)
    shared = np.linalg.inv(weights.sum(axis=0))
    mean = shared @ np.einsum("kij,kj->i", weights, errors)
    rest = errors - mean
    dof = 6 * (len(errors) - 1)
    scale = max(float(np.einsum("ki,kij,kj->", rest, weights, rest)) / dof, 1.0)
    return mean, scale * shared, dof


def _certain(bounds: Field, mean: Field) -> Field:
    """Return the mean (6,) with what isn't certain at zero, the rest solved anew for that.

    Parameters
    ----------
    bounds : (6, 6), covariance of the mean, scaled so that its root is the interval's half width
    """
    weight = np.linalg.inv(bounds)
    right = weight @ mean
    kept = np.arange(mean.size)
    while kept.size:
        inverse = np.linalg.inv(weight[np.ix_(kept, kept)])
        solved = inverse @ right[kept]
        share = np.abs(solved) / np.sqrt(np.diag(inverse))
        if share.min() > 1:
            break
        kept = np.delete(kept, share.argmin())
    out = np.zeros(mean.size)
    if kept.size:
        out[kept] = solved
    return out


def _in_sensor(commanded: Field, placement: Placement) -> Field:
    """Express a placement as an error in the sensor's frame, true = commanded · error: (6,)."""
    middle = commanded[len(commanded) // 2]
    shift = placement.shift
    turn = Rotation.from_rotvec(shift[3:6]).as_matrix()
    true = middle.copy()
    true[:3, 3] += travel_columns(commanded)[len(commanded) // 2] @ shift[6:]
    true[:3, 3] = turn @ (true[:3, 3] - placement.centre_mm) + placement.centre_mm + shift[:3]
    true[:3, :3] = turn @ true[:3, :3]
    error = np.linalg.inv(middle) @ true
    angles = Rotation.from_matrix(error[:3, :3]).as_euler("ZYX")
    return np.concatenate([[math.degrees(a) for a in angles], error[:3, 3]])


def _uncertainty(commanded: Field, placement: Placement) -> Field:
    """Covariance (6, 6) of an error in the sensor's frame: what faces settle, and `SLACK`.

    Where a part's faces leave a direction open, so does a placement.
    """
    slopes = _slopes(commanded, placement)
    return np.asarray(slopes @ placement.covariance @ slopes.T + np.diag(SLACK**2))


def _slopes(commanded: Field, placement: Placement) -> Field:
    """Change of the error in the sensor's frame by each number of a placement, (6, 9)."""
    step = 1e-3 * PRIOR_SD
    middle = _in_sensor(commanded, placement)
    return np.stack(
        [
            (_in_sensor(commanded, replace(placement, shift=placement.shift + d)) - middle) / d[k]
            for k, d in enumerate(np.diag(step))
        ],
        axis=1,
    )


def part_lies(effect: PoseError, commanded: Field, placement: Placement) -> Field:
    """Directions (9, k) in which the part may lie otherwise than told: not those of the mounting.

    Orthonormal, in prior deviations of a placement; its travel stays.
    """
    told = [k for k, name in enumerate(NAMES) if getattr(effect, name) != 0.0]
    rigid = (_slopes(commanded, placement) * PRIOR_SD)[told, :6]
    free = null_space(rigid / np.linalg.norm(rigid, axis=1, keepdims=True))
    return np.vstack([free, np.zeros((PRIOR_SD.size - 6, free.shape[1]))])


def _spread_deg(commanded: Sequence[Field]) -> float:
    """Largest turn between the recordings' orientations."""
    first = Rotation.from_matrix(commanded[0][0, :3, :3])
    turns = [(first.inv() * Rotation.from_matrix(p[0, :3, :3])).magnitude() for p in commanded]
    return math.degrees(max(turns))
