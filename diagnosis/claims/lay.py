"""A lay: the direction on the part along which its noise is drawn out.

At lags of about one distance the autocorrelation goes with the lag's direction θ, in its lowest
order, as

    ρ(θ) = ρ₀ + u cos 2θ + v sin 2θ.

In recording k of the part, z = (u, v) in the sensor's frame is

    z_k = a + b + T_k (L₀ + L) + e_k

a what plates or baselines have, b what has changed of the sensor's own, L₀ a lay that baselines or
the sensor's file have, L the lay, T_k how the part lay turned, e_k what changes from one recording
to the next. All are normal. Baselines have a, L₀ and e, of any size; without them a is the plates',
and nobody knows the sizes of b, e and L: the odds are averaged over them, as with the mounting.
Recordings in one orientation can't tell b from L, two can't tell e, and the odds say so.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from diagnosis.data.patch import Patch
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel, calibrate
from sensors.effects.anisotropic_lay import AnisotropicLay

DISTANCES = ((0.9, 2.0), (2.0, 4.0), (4.0, 8.0))
"""Lags that go together, over the coarser pitch: octaves."""
SIZES = np.geomspace(0.005, 0.64, 8)
"""Sizes by which an autocorrelation may change: from what 40 000 readings show, in octaves."""
OFFSETS = np.append(0.0, SIZES)
ANY = 1.0
"""Size of what may be any: no autocorrelation is larger."""
CORRELATED = 0.05
"""Autocorrelation from which it isn't the measurement's own noise."""
LEAST_READINGS = 3000
LEAST_LAGS = 4


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Drawn:
    """How a recording's autocorrelation goes with the direction of the lag, sensor's frame.

    Attributes
    ----------
    z : (J, 2) float64
        At each distance.
    variance : (J,) float64
        Of each number, by the readings that it was measured on.
    stretch : (2,) float64
        Logarithm of the longest over the shortest correlation length, as a vector of twice the
        direction.
    """

    z: Field
    variance: Field
    stretch: Field


@dataclass(frozen=True, kw_only=True, slots=True)
class Lay:
    """Evidence for a lay.

    Attributes
    ----------
    nats : log Bayes factor of a lay against none
    angle_rad : its direction on the part, from x towards y
    """

    nats: float
    angle_rad: float


def drawn(noise: NoiseModel) -> Drawn:
    """Fit the lowest order at each distance; a lag stands for its opposite, too.

    An autocorrelation measured on N readings has the variance Σρ²/N at lags where there is none
    (Bartlett, J. R. Stat. Soc. Suppl. 8 (1946) 27).
    """
    ly, lx = noise.lags
    down, right = np.mgrid[-ly : ly + 1, -lx : lx + 1].astype(float)
    x, y = right * noise.pitch_x_mm, down * noise.pitch_y_mm
    far = np.hypot(x, y) / max(noise.pitch_x_mm, noise.pitch_y_mm)
    once = (down > 0) | ((down == 0) & (right > 0))
    one = float(np.square(noise.acf).sum()) / max(noise.readings, 1)
    z, variance = np.zeros((len(DISTANCES), 2)), np.full(len(DISTANCES), ANY**2)
    for j, (low, high) in enumerate(DISTANCES):
        pick = once & (far >= low) & (far < high)
        if pick.sum() < LEAST_LAGS:
            continue
        twice = 2 * np.arctan2(y[pick], x[pick])
        columns = np.stack([np.ones(twice.size), np.cos(twice), np.sin(twice)], axis=1)
        inverse = np.linalg.pinv(columns.T @ columns)
        z[j] = (inverse @ columns.T @ noise.acf[pick])[1:]
        variance[j] = one * float(inverse[1, 1] + inverse[2, 2]) / 2
    return Drawn(z=z, variance=variance, stretch=_stretch(noise))


def lay_of(
    ws: Workspace, model: Model, nominal: NoiseModel, baseline: Sequence[Patch] = ()
) -> tuple[AnisotropicLay, float] | None:
    """Return the likeliest lay and its log Bayes factor; None where too little was read.

    Parameters
    ----------
    ws : of all recordings
    nominal : noise of plates, or of baselines
    """
    seen, turns = _recorded(ws, model, nominal)
    if not seen:
        return None
    before = Workspace.build(baseline, ws.noise) if baseline else None
    good, turned = _recorded(before, Model(), nominal) if before else ([], [])
    plate = drawn(nominal)
    listed = any(isinstance(e, AnisotropicLay) for e in ws.patches[0].view.sensor.effects)
    found = lay_evidence(seen, turns, good, turned, plate, listed=listed)
    stretch = np.mean(
        [t.T @ (d.stretch - plate.stretch) for d, t in zip(seen, turns, strict=True)], axis=0
    )
    ratio = float(np.clip(math.exp(np.linalg.norm(stretch)), 1, 50))
    return AnisotropicLay(ratio=ratio, angle_deg=math.degrees(found.angle_rad)), found.nats


def lay_evidence(
    seen: Sequence[Drawn],
    turns: Sequence[Field],
    good: Sequence[Drawn],
    turned: Sequence[Field],
    plate: Drawn,
    *,
    listed: bool = False,
) -> Lay:
    """Weigh whether what draws the noise out turns with the part; see the module's equation.

    The numbers y of one distance, stacked, have the covariance D + τ² + β²BB' + λ²LL' and what
    baselines have, D what readings leave open.

    Parameters
    ----------
    seen, good : recordings and baselines
    turns, turned : of each, from the part's frame to the sensor's, (2, 2)
    plate : what the sensor has of its own, where there are no baselines
    listed : whether the sensor's file has a lay
    """
    every, count = [*seen, *good], 2 * (len(seen) + len(good))
    same, turn = np.tile(np.eye(2), (len(every), 1)), np.concatenate([*turns, *turned])
    now = np.arange(count)[:, None] < 2 * len(seen)
    new, lay = same * now, turn * now
    known = ANY**2 * (same @ same.T * bool(good) + turn @ turn.T * (listed or bool(good)))
    scatter, changed, size = np.meshgrid(SIZES, OFFSETS, OFFSETS, indexing="ij")
    shared = (
        np.square(scatter)[..., None, None] * np.eye(count)
        + np.square(changed)[..., None, None] * (new @ new.T)
        + np.square(size)[..., None, None] * (lay @ lay.T)
    )
    logs, ways = np.zeros(size.shape), np.zeros((*size.shape, 2))
    for j in range(len(DISTANCES)):
        y = np.concatenate([d.z[j] - plate.z[j] * (not good) for d in every])
        fixed = known + np.diag(np.repeat([d.variance[j] for d in every], 2))
        if not good:
            fixed = fixed + plate.variance[j] * same @ same.T
        covariance = fixed + shared
        right = np.broadcast_to(y[:, None], (*size.shape, count, 1))
        solved = np.linalg.solve(covariance, right)[..., 0]
        logs -= 0.5 * (np.linalg.slogdet(covariance)[1] + solved @ y)
        # largest where it is nearest: speckle that is drawn out may turn negative far from there
        ways += np.square(size)[..., None] * (solved @ lay)
    way = np.einsum("abc,abck->k", np.exp(logs - logsumexp(logs)), ways)
    return Lay(
        nats=float(logsumexp(logs[..., 1:]) - math.log(len(SIZES)) - logsumexp(logs[..., 0])),
        angle_rad=0.5 * math.atan2(way[1], way[0]),
    )


def _recorded(
    ws: Workspace, model: Model, nominal: NoiseModel
) -> tuple[list[Drawn], list[Field]]:
    """Measure each recording; how the part lay turned in it."""
    states = ws.states(ws.predict(model))
    found, turns = [], []
    for number in sorted({p.recording for p in ws.patches}):
        members = [
            (p, s) for p, s in zip(ws.patches, states, strict=True) if p.recording == number
        ]
        masks = [p.fit & s.used & ~p.edge for p, s in members]
        if sum(int(m.sum()) for m in masks) < LEAST_READINGS:
            continue
        own = calibrate(
            [s.residual_mm / s.sd_mm for _, s in members], masks,
            pitch_mm=(nominal.pitch_x_mm, nominal.pitch_y_mm), missing_share=0.0,
            from_reference=False,
        )  # fmt: skip
        found.append(drawn(own))
        turns.append(_turn(members[0][0]))
    return found, turns


def _turn(patch: Patch) -> Field:
    """Map twice a direction on the part to twice the same in the scan, (2, 2).

    Directions in the scan run from the laser line towards the travel, which may be mirrored.
    """
    poses = patch.view.poses
    line, travel = poses[0, :2, 0], poses[-1, :2, 3] - poses[0, :2, 3]
    u, v = line / max(float(np.linalg.norm(line)), 1e-9)
    twice = np.array([[u * u - v * v, 2 * u * v], [-2 * u * v, u * u - v * v]])
    mirrored = u * travel[1] - v * travel[0] < 0
    return np.diag([1.0, -1.0]) @ twice if mirrored else twice


def _stretch(noise: NoiseModel) -> Field:
    """How noise is drawn out, by the second moments M of its positive autocorrelation, (2,).

    With L = ln M, a reading's own size added to M: s = ((L_xx - L_yy) / 2, L_xy).
    """
    ly, lx = noise.lags
    weight = np.where(noise.acf > CORRELATED, noise.acf, 0.0)
    weight /= weight.sum()
    down, right = np.mgrid[-ly : ly + 1, -lx : lx + 1]
    steps = np.stack([right * noise.pitch_x_mm, down * noise.pitch_y_mm])
    own = np.diag([noise.pitch_x_mm**2, noise.pitch_y_mm**2]) / 12
    values, vectors = np.linalg.eigh(np.einsum("nm,inm,jnm->ij", weight, steps, steps) + own)
    log = vectors @ np.diag(np.log(values)) @ vectors.T
    return np.array([0.5 * (log[0, 0] - log[1, 1]), log[0, 1]])
