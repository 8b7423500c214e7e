"""The mounting: whether the recordings' placements agree in the sensor's own frame.

Every other test takes a recording's rigid misplacement as a nuisance. Where the corrections of
several recordings agree in the sensor's frame, far better than they scatter, it isn't the part that
lay wrong each time but the sensor that sits wrong: pose_error.

An error is what all share, what the faces of a part leave open, and how that part lies, by as much
along each axis: a random effects model. Placements are few; their readings, however many, settle
each of them once.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from scipy.special import fdtrc, stdtrit

from diagnosis.data.patch import Patch
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.uncertainty import Estimate
from diagnosis.register.placement import PRIOR_SD, Placement
from diagnosis.register.pose_derivative import travel_columns
from diagnosis.validate.found_effects import FoundEffect, plainly_found
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.pose_error import PoseError
from sensors.recording import Recording

NAMES = ("yaw_deg", "roll_deg", "pitch_deg", "x_mm", "y_mm", "z_mm")
LEVEL = 5e-3
"""Probability of as large an error by chance; held-out placements have to bear it out, too."""
LEAST = np.array([0.02, 0.02, 0.02, 0.04, 0.04, 0.04])
"""Smallest turns (degrees) and offsets (mm) that are worth telling."""
LEAST_NATS = 1.0
"""What it must gain on held-out placements: they are more than twice as likely with it."""
SLACK = np.array([0.01, 0.01, 0.01, 0.01, 0.01, 0.02])
"""What registration alone scatters: turns in degrees, offsets in mm."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Seen:
    """Where one recording was found to lie, in the sensor's frame.

    Attributes
    ----------
    error : (6,) float64
        As `NAMES`.
    unsettled : (6, 6) float64
        Its covariance: what faces settle, and `SLACK`. Where a part's faces leave a direction open,
        so does a placement.
    slopes : (6, 6) float64
        Change of the error by how the part lies: mm, and rad about its middle.
    """

    error: Field
    unsettled: Field
    slopes: Field

    @classmethod
    def of(cls, commanded: Field, placement: Placement, travel_mm: float = 0.0) -> "_Seen":
        slopes = _slopes(commanded, placement)
        unsettled = slopes @ placement.covariance @ slopes.T + np.diag(SLACK**2)
        unsettled[4, 4] += travel_mm**2
        error = _in_sensor(commanded, placement)
        return cls(error=error, unsettled=unsettled, slopes=slopes[:, :6])

    def covariance(self, lies: Field) -> Field:
        """Covariance (6, 6) of the error of a part that lies off by (2,) mm and rad."""
        return np.asarray(self.unsettled + (self.slopes * np.repeat(lies**2, 3)) @ self.slopes.T)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Mounting:
    """A common error of the mounting with its intervals.

    Attributes
    ----------
    unsure : (6, 6) float64
        Covariance of what the fitted recordings say of it.
    lies, lies_off : (2,) float64
        How parts lie off along each axis, mm and rad: about the mounting, and if there is none.
    """

    effect: PoseError
    intervals: dict[str, Estimate]
    unsure: Field
    lies: Field
    lies_off: Field

    def gain(self, commanded: Field, placement: Placement) -> float:
        """Nats that the mounting gains on where another recording was found to lie.

        A placement is one number per direction, however many readings it was settled by. Either
        the part lies off from the mounting as the fitted ones do, or from nothing.
        """
        seen = _Seen.of(commanded, placement)
        told = np.array([getattr(self.effect, name) for name in NAMES])
        with_it = seen.covariance(self.lies) + self.unsure
        without = seen.covariance(self.lies_off)
        return _log_normal(seen.error - told, with_it) - _log_normal(seen.error, without)


def _log_normal(off: Field, covariance: Field) -> float:
    """Log density of a normal distribution at an offset from its mean, but for a constant."""
    _, size = np.linalg.slogdet(covariance)
    return -0.5 * float(off @ np.linalg.solve(covariance, off) + size)


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
    seen = [_Seen.of(p, q, travel_mm) for p, q in zip(commanded, placements, strict=True)]
    lies = _scatter(seen, shared=True)
    mean, shared, dof = _agreed(seen, lies)
    tail = float(fdtrc(6, dof, mean @ np.linalg.solve(shared, mean) / 6))
    reach = float(stdtrit(dof, 0.975))
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
            n: Estimate(value=float(v), low=float(v - reach * s), high=float(v + reach * s))
            for n, v, s in zip(NAMES, mean, sd, strict=True)
        },
        unsure=shared,
        lies=lies,
        lies_off=_scatter(seen, shared=False),
    )


def _agreed(seen: Sequence[_Seen], lies: Field) -> tuple[Field, Field, int]:
    """Mean (6,) of the errors, its covariance by their scatter, and its degrees of freedom."""
    errors, weights, mean, shared = _weighed(seen, lies)
    dof = 6 * (len(errors) - 1)
    return mean, max(_square(errors - mean, weights) / dof, 1.0) * shared, dof


def _weighed(seen: Sequence[_Seen], lies: Field) -> tuple[Field, Field, Field, Field]:
    """Errors (k, 6), their weights (k, 6, 6), the mean (6,) by these and its covariance (6, 6)."""
    errors = np.stack([s.error for s in seen])
    weights = np.asarray(np.linalg.inv([s.covariance(lies) for s in seen]), np.float64)
    shared = np.asarray(np.linalg.inv(weights.sum(axis=0)), np.float64)
    return errors, weights, shared @ np.einsum("kij,kj->i", weights, errors), shared


def _square(rest: Field, weights: Field) -> float:
    """Sum of squares of what is left (k, 6), weighted."""
    return float(np.einsum("ki,kij,kj->", rest, weights, rest))


def _scatter(seen: Sequence[_Seen], *, shared: bool) -> Field:
    """How far parts lie off along each axis, mm and rad (2,), by restricted likelihood.

    Twice its negative logarithm is Σ ln|S_k| + ln|Σ S_k⁻¹| + Σ r_k' S_k⁻¹ r_k, S_k the covariance
    of recording k, r_k its error beyond the shared one (Patterson, Thompson, Biometrika 58 (1971)
    545).

    Parameters
    ----------
    shared : about an error that all share, else about none
    """

    def unlikely(log_lies: Field) -> float:
        errors, weights, mean, unsure = _weighed(seen, np.exp(log_lies))
        cost = -float(np.linalg.slogdet(weights)[1].sum())
        if not shared:
            return cost + _square(errors, weights)
        return cost - float(np.linalg.slogdet(unsure)[1]) + _square(errors - mean, weights)

    least, most = 1e-3 * PRIOR_SD[[0, 3]], PRIOR_SD[[0, 3]]
    found = minimize(
        unlikely, np.log(0.03 * most), method="L-BFGS-B",
        bounds=list(zip(np.log(least), np.log(most), strict=True)),
    )  # fmt: skip
    return np.asarray(np.exp(found.x))


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


def _spread_deg(commanded: Sequence[Field]) -> float:
    """Largest turn between the recordings' orientations."""
    first = Rotation.from_matrix(commanded[0][0, :3, :3])
    turns = [(first.inv() * Rotation.from_matrix(p[0, :3, :3])).magnitude() for p in commanded]
    return math.degrees(max(turns))


def mounted(
    ws: Workspace,
    model: Model,
    recordings: Sequence[Recording],
    placed: Mapping[str, Placement],
    held: Sequence[Patch],
) -> list[FoundEffect]:
    """Return the mounting error that fitted recordings share, if held-out recordings support it."""
    moved = ws.placements(model)
    fitted = [placed[recordings[k].name].further(moved[k]) for k in moved]
    mounting = mounting_error(
        [recordings[k].poses for k in moved], fitted, travel_mm=travelled_mm(ws, model)
    )
    if mounting is None:
        return []
    apart = Workspace.build(held, ws.noise)
    moved = apart.placements(model, [p.counted & ~p.edge for p in held])
    gain = sum(
        mounting.gain(recordings[k].poses, placed[recordings[k].name].further(step))
        for k, step in moved.items()
    )
    if gain < LEAST_NATS:
        return []
    per_reading = gain / max(sum(int(p.counted.sum()) for p in held), 1)
    return [
        plainly_found(
            mounting.effect, per_reading, mounting.intervals,
            probability=1.0 - np.exp(-gain),
        )
    ]  # fmt: skip


def travelled_mm(ws: Workspace, model: Model) -> float:
    """Half of the longest way during an exposure: where in it a pose is stated isn't known."""
    ways = [blur.longest_way_mm(p.view) for blur in blurs(model) for p in ws.patches]
    return 0.5 * float(max(ways, default=0.0))


def blurs(model: Model) -> list[MotionBlur]:
    """Return the blurs of a model."""
    return [e for e in model.effects if isinstance(e, MotionBlur)]
