"""The mounting: whether the recordings' placements agree in the sensor's own frame.

Every other test takes a recording's rigid misplacement as a nuisance. Where the corrections of
several recordings agree in the sensor's frame, far better than they scatter, it isn't the part that
lay wrong each time but the sensor that sits wrong: pose_error.

The error of recording k, in the sensor's frame, is

    e_k = m + b + J_k (c + a_k) + u_k,

m what the mounting is off, c how the part lay in all recordings (a fixture, the CAD's zero), a_k
how it lay in this one, J_k how a part's displacement looks from the sensor, u_k what registration
leaves open. All are normal. Where there are baselines, they have b and no m, so that m is what has
changed; without them there is no b. Nobody knows beforehand how far parts and sensors are off: the
odds are averaged over sizes of m and a that are equally probable on a logarithmic scale, up to how
far a commanded pose may be off at all. Recordings in one orientation can't tell m from c, and the
odds say so. Placements are few; their readings, however many, settle each of them once.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp, ndtr

from diagnosis.data.patch import Patch
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.uncertainty import LEVEL, Estimate
from diagnosis.register.placement import PRIOR_SD, Placement
from diagnosis.register.pose_derivative import travel_columns
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect, plainly_found
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.pose_error import PoseError
from sensors.recording import Recording

NAMES = ("yaw_deg", "roll_deg", "pitch_deg", "x_mm", "y_mm", "z_mm")
SLACK = np.array(SETTINGS.claims.slack())
"""What registration alone scatters: turns in degrees, offsets in mm."""
UNIT = np.array([*np.degrees(PRIOR_SD[3:6]), *PRIOR_SD[:3]])
"""How far a commanded pose may be off, degrees and mm."""
SCATTERS = SETTINGS.claims.mounting_scatters()
"""Sizes of a, its shift and its turn, in `UNIT`: from far below `SLACK`."""
TINY = 1e-9
"""What counts as no deviation, degrees and mm."""
OFFSETS = SETTINGS.claims.mounting_offsets()
"""Sizes of m, its shift and its turn, in `UNIT`: none, or from 0.02 mm and 0.01 degrees."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Misplaced:
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
    def of(cls, commanded: Field, placement: Placement, travel_mm: float = 0.0) -> "Misplaced":
        """Express a placement; `travel_mm` is how far along the travel its poses may be off."""
        slopes = _slopes(commanded, placement)
        unsettled = slopes @ placement.covariance @ slopes.T + np.diag(SLACK**2)
        unsettled[4, 4] += travel_mm**2
        error = _in_sensor(commanded, placement)
        return cls(error=error, unsettled=unsettled, slopes=slopes[:, :6])


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Mounting:
    """The error of the mounting, by where the recordings were found to lie.

    Attributes
    ----------
    nats : log Bayes factor of a mounting that is off against one that isn't
    weights : (s,) float64
        Probability of each pair of sizes (of the parts' scatter, of the mounting's error).
    means, covariances : (s, 6), (s, 6, 6) float64
        The mounting's error, given each of them.
    """

    nats: float
    weights: Field
    means: Field
    covariances: Field

    @property
    def error(self) -> Field:
        """Most probable error (6,); what may as well be none is zero, and the rest fitted so.

        Where each number by itself may as well be none, the surest isn't.
        """
        mean = self.weights @ self.means
        off = self.means - mean
        covariance = np.einsum("s,sij->ij", self.weights, self.covariances)
        weight = np.linalg.pinv(covariance + np.einsum("s,si,sj->ij", self.weights, off, off))
        sides = np.array([[self.below(k, 0.0), self.below(k, 0.0, up=True)] for k in range(6)])
        unsure = sides.min(axis=1)
        kept = np.flatnonzero(unsure <= max(float(unsure.min()), (1 - LEVEL) / 2))
        out = np.zeros(6)
        out[kept] = np.linalg.solve(weight[np.ix_(kept, kept)], (weight @ mean)[kept])
        return out

    def interval(self, k: int) -> tuple[float, float]:
        """95 % interval of number k, by the distribution averaged over sizes."""
        mean, sd = self.means[:, k], np.sqrt(self.covariances[:, k, k])
        ends = (mean - 10 * sd).min() - TINY, (mean + 10 * sd).max() + TINY
        rest = (1 - LEVEL) / 2
        low, high = (
            brentq(lambda value, s=s: self.below(k, value) - s, *ends) for s in (rest, 1 - rest)
        )
        return float(low), float(high)

    def below(self, k: int, value: float, *, up: bool = False) -> float:
        """Probability that number k isn't above a value, or isn't below (`up`)."""
        sd = np.maximum(np.sqrt(self.covariances[:, k, k]), TINY)
        side = -1.0 if up else 1.0
        return float(self.weights @ ndtr((side * (value - self.means[:, k]) + 8 * TINY) / sd))


def mounting_error(seen: Sequence[Misplaced], good: Sequence[Misplaced] = ()) -> Mounting:
    """Weigh whether the mounting is off; see the module's equation.

    Placements' errors, stacked, have the covariance D + X P X', D that of each recording by itself,
    X = [J | b | m] what the recordings share, P how large that may be. With G = X'D⁻¹X,
    v = X'D⁻¹e

        2 ln p(e) = -ln|D| - ln|I + G P| - e'D⁻¹e + v'(P⁻¹ + G)⁻¹v + constant.

    Parameters
    ----------
    good : of the baselines, with the mounting as it was
    """
    same, none = np.eye(6), np.zeros((6, 6))
    shared = np.stack([
        *(np.hstack([s.slopes, same if good else none, same]) for s in seen),
        *(np.hstack([s.slopes, same, none]) for s in good),
    ])  # fmt: skip
    seen = [*seen, *good]
    errors = np.stack([s.error for s in seen])
    part = PRIOR_SD[:6]
    scatters, offs = list(product(SCATTERS, repeat=2)), list(product(OFFSETS, repeat=2))
    logs = np.empty((len(scatters), len(offs)))
    means, covariances = np.empty((*logs.shape, 6)), np.empty((*logs.shape, 6, 6))
    for i, (far, turned) in enumerate(scatters):
        lies = np.square(np.repeat([far, turned], 3) * part)
        own = np.stack([s.unsettled + (s.slopes * lies) @ s.slopes.T for s in seen])
        inverse = np.linalg.inv(own)
        gram = np.einsum("kia,kij,kjb->ab", shared, inverse, shared)
        right = np.einsum("kia,kij,kj->a", shared, inverse, errors)
        alone = -np.linalg.slogdet(own)[1].sum() - np.einsum("ki,kij,kj", errors, inverse, errors)
        for j, (shift, turn) in enumerate(offs):
            scale = np.concatenate([part, UNIT, np.repeat([turn, shift], 3) * UNIT])
            inner = np.eye(18) + scale[:, None] * gram * scale
            posterior = scale[:, None] * np.linalg.inv(inner) * scale
            logs[i, j] = 0.5 * (alone - np.linalg.slogdet(inner)[1] + right @ posterior @ right)
            means[i, j], covariances[i, j] = (posterior @ right)[12:], posterior[12:, 12:]
    off = logs[:, 1:]
    return Mounting(
        nats=float(logsumexp(off) - np.log(off.shape[1]) - logsumexp(logs[:, 0])),
        weights=np.exp(off - logsumexp(off)).ravel(),
        means=means[:, 1:].reshape(-1, 6),
        covariances=covariances[:, 1:].reshape(-1, 6, 6),
    )


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


def mounted(
    ws: Workspace,
    model: Model,
    recordings: Sequence[Recording],
    placed: Mapping[str, Placement],
    held: Sequence[Patch],
    baseline: Sequence[Patch] = (),
) -> list[FoundEffect]:
    """Return the mounting error that recordings share, if those held out support it.

    Its numbers and its probability are those of the fitted recordings. What it gains on held-out
    ones is how much more probable their placements are, given the fitted ones.

    Parameters
    ----------
    recordings : baselines included
    """
    commanded = {r.name: r.poses for r in recordings}

    def lie(patches: Sequence[Patch], steps: Mapping[int, Field], travel: float) -> list[Misplaced]:
        of = {p.recording: p.name for p in patches}
        return [
            Misplaced.of(commanded[of[k]], placed[of[k]].further(step), travel)
            for k, step in steps.items()
        ]

    seen = lie(ws.patches, ws.placements(model), travelled_mm(ws, model))
    good = (
        lie(baseline, Workspace.build(baseline, ws.noise).placements(Model()), 0.0)
        if baseline else []
    )  # fmt: skip
    mounting = mounting_error(seen, good)
    sure, error = SETTINGS.probability(mounting.nats, "pose_error"), mounting.error
    if sure <= SETTINGS.reported:
        return []
    apart = Workspace.build(held, ws.noise)
    moved = apart.placements(model, [p.counted & ~p.edge for p in held])
    others = lie(held, moved, 0.0)
    every = mounting_error([*seen, *others], good).nats
    if SETTINGS.probability(every, "pose_error") <= SETTINGS.reported:
        return []
    bounds = {p.name: (p.low, p.high) for p in PoseError.parameters()}
    values = {n: float(np.clip(v, *bounds[n])) for n, v in zip(NAMES, error, strict=True) if v}
    ends = [mounting.interval(k) for k in range(6)]
    return [
        plainly_found(
            PoseError.none().with_parameters(values),
            (every - mounting.nats) / max(sum(int(p.counted.sum()) for p in held), 1),
            {
                n: Estimate(value=values.get(n, 0.0), low=low, high=high)
                for n, (low, high) in zip(NAMES, ends, strict=True)
            },
            probability=sure,
        )
    ]  # fmt: skip


def travelled_mm(ws: Workspace, model: Model) -> float:
    """Half of the longest way during an exposure: where in it a pose is stated isn't known."""
    ways = [blur.longest_way_mm(p.view) for blur in blurs(model) for p in ws.patches]
    return 0.5 * float(max(ways, default=0.0))


def blurs(model: Model) -> list[MotionBlur]:
    """Return the blurs of a model."""
    return [e for e in model.effects if isinstance(e, MotionBlur)]
