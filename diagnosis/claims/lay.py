"""A lay: the direction on the part along which its noise is drawn out.

Over the nominal spectrum f₀, and but for its level, the spectrum of recording k is

    f_k / f₀ - 1 = s + b + e_k + T_k (L₀ + L) / f₀

f₀ with what a finish adds to it, the same in all directions, s what f₀ is off, b what has changed
of the sensor's own, e_k what changes from one recording to the next, L₀ a lay that baselines or the
sensor's file have, L the lay, T_k how the part lay turned. Baselines have s, e and L₀, plates s and
e. A lay is a strip across its direction (`noise_spectrum.py`) with a share of the variance in each
octave of wavelengths, normal, as b and e are at each lag, and s is any. By Whittle's likelihood
(Ark. Mat. 2 (1953) 423), to second order, autocorrelations of N whitened readings are independent
with the variance 1 / N.
Nobody knows the strip's direction and width and the sizes of b, e, L₀ and L: the odds are averaged
over them, as with the mounting.
A finish is one draw of what it could be: by chance it has more waves in one direction than in
another, and the same ones in all recordings of a part. Its readings count once. Noise of good
instruments seems to have a lay as well, since it goes with the slopes of the part: how much was
learnt from them. A lay must be more probable, too, than a strip that stays in the sensor's frame,
as likely before any reading, and than strips of each recording's own: what draws the noise of good
instruments out a little is another in each recording.
Recordings in one orientation can't tell a lay from the sensor, and the odds say so.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from diagnosis.claims.noise_of_recordings import off_edges
from diagnosis.claims.noise_spectrum import WIDTHS, Spectra, products
from diagnosis.data.patch import Patch
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS
from sensors.effects.anisotropic_lay import AnisotropicLay

ANGLES_RAD = SETTINGS.claims.lay_angles_rad()
LAY = "spectrum: lay"
"""Name of the sizes of the lay that the noise of good instruments seems to have."""
SHARES = SETTINGS.mean_sizes()
"""Sizes of a lay, over the variance."""
SHARES_BEFORE = np.append(0.0, SHARES[::3])
"""Sizes of the lay that baselines have; it is as likely that they have none."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Lay:
    """Evidence for a lay.

    Attributes
    ----------
    factors : (S,) log Bayes factor of each size of a lay against none
    angle_rad : its direction on the part, from x towards y
    """

    factors: Field
    angle_rad: float


def lay_of(
    ws: Workspace, model: Model, nominal: NoiseModel, baseline: Sequence[Patch] = ()
) -> tuple[AnisotropicLay, Field] | None:
    """Return the likeliest lay and log Bayes factors of its sizes; None where too little was read.

    Parameters
    ----------
    ws : of all recordings
    nominal : noise of plates, or of baselines
    """
    seen, turns = _recorded(ws, model, nominal)
    if not seen or min(nominal.lags) < SETTINGS.claims.lay_reach:
        return None
    before = Workspace.build(baseline, ws.noise) if baseline else None
    good, turned = _recorded(before, Model(), nominal) if before else ([], [])
    listed = any(isinstance(e, AnisotropicLay) for e in ws.patches[0].view.sensor.effects)
    found = lay_evidence(seen, turns, good, turned, nominal, listed=listed)
    stretch = np.mean(
        [t.T @ (stretched(n) - stretched(nominal)) for n, t in zip(seen, turns, strict=True)],
        axis=0,
    )
    ratio = float(np.clip(math.exp(np.linalg.norm(stretch)), 1, 50))
    return AnisotropicLay(ratio=ratio, angle_deg=math.degrees(found.angle_rad)), found.factors


def lay_evidence(
    seen: Sequence[NoiseModel],
    turns: Sequence[Field],
    good: Sequence[NoiseModel],
    turned: Sequence[Field],
    nominal: NoiseModel,
    *,
    listed: bool = False,
) -> Lay:
    """Weigh whether what draws the noise out turns with the part; see the module's equation.

    Parameters
    ----------
    seen, good : noise of recordings and of baselines
    turns, turned : of each, (2, 2), from twice a direction on the part to twice that in the scan
    nominal : noise of plates, where there are no baselines
    listed : whether the sensor's file has a lay
    """
    spectra = Spectra.of([*seen, *good] if good else [*seen, nominal], nominal)
    rows, count = len(spectra.readings), len(seen)
    now = (np.arange(rows) < count).astype(float)
    # what lies on a part is the same in all recordings of it: its readings count once
    spectra = replace(
        spectra, readings=spectra.readings / np.where(now > 0, count, max(len(good), 1))
    )
    on_part = np.ones(rows) if good else now
    before, likely = SHARES_BEFORE[:1], np.ones(1)
    if good or listed:
        more = SHARES_BEFORE.size - 1
        before, likely = SHARES_BEFORE, np.append(0.5, np.full(more, 0.5 / more))
    shares = np.stack(np.meshgrid(before, np.append(0.0, SHARES), indexing="ij"), axis=-1)
    logs = _averaged(spectra, now, _strips(spectra, [*turns, *turned]), [on_part, now], shares)
    logs += np.log(likely)[:, None]
    there = logsumexp(logs[..., 1:], axis=1)
    none = logsumexp(logs[..., 0])
    still = _strips(spectra, [np.eye(2)] * count)
    sensor, *each = (
        logsumexp(_averaged(spectra, now, still, [who], SHARES[:, None])) - math.log(SHARES.size)
        for who in [now, *np.eye(rows)[:count]]
    )
    own = none + np.maximum(np.array(each) - none, 0).sum()
    others = [none, sensor + SETTINGS.log_odds(AnisotropicLay.name), own]
    each_way = np.exp(there - there.max()).sum(axis=1)
    way = each_way @ np.exp(2j * np.repeat(ANGLES_RAD, len(WIDTHS)))
    return Lay(
        factors=np.asarray(logsumexp(there, axis=0) - logsumexp(others)),
        angle_rad=0.5 * float(np.angle(way)),
    )


def _strips(spectra: Spectra, turns: Sequence[Field]) -> tuple[Field, Field]:
    """Products of all strips of the recordings, (M, R, B, R, B), and with spectra, (M, R, B, R).

    A plate at the end has none, and recordings for which there is no turn.
    """
    turned = np.stack([
        t @ np.stack([np.cos(2 * ANGLES_RAD), np.sin(2 * ANGLES_RAD)]) for t in turns
    ])  # fmt: skip
    angles = 0.5 * np.arctan2(turned[:, 1], turned[:, 0])
    between, towards = [], []
    for seen in angles.T:
        for width in WIDTHS:
            strips = spectra.strips(seen, width)
            rows = np.zeros((len(spectra.readings), *strips.shape[1:]))
            rows[: len(strips)] = strips
            between.append(products(rows, rows))
            towards.append(products(rows, spectra.ratio))
    return np.stack(between), np.stack(towards)


def _averaged(
    spectra: Spectra, now: Field, strips: tuple[Field, Field], who: Sequence[Field], shares: Field
) -> Field:
    """Log likelihood of each strip and its shares, (M, ...), averaged over sizes of b and e.

    Parameters
    ----------
    now : (R,) 1 where there is b
    who : K of (R,), 1 where there is a strip
    shares : (..., K) size of each
    """
    changes = SETTINGS.claims.lay_other_changes()
    logs = [
        _log_likelihood(spectra, strips, np.stack(who), shares, c * now, e)
        for c in changes
        for e in changes
    ]
    return np.asarray(logsumexp(logs, axis=0))


def _log_likelihood(
    spectra: Spectra, strips: tuple[Field, Field], who: Field, shares: Field, b: Field, e: float
) -> Field:
    """Log likelihood of each strip and its shares, (M, ...), but for a constant.

    At each lag the recordings have the covariance 1 / N + e² + b b' and an unknown mean.
    """
    between, towards = strips
    covariance = np.diag(1 / spectra.readings + e**2) + np.outer(b, b)
    inverse = np.linalg.inv(covariance)
    total = inverse.sum(axis=0)
    inverse -= np.outer(total, total) / total.sum()
    alone = -0.5 * spectra.free * (np.linalg.slogdet(covariance)[1] + math.log(total.sum()))
    alone -= 0.5 * float(np.einsum("lr,rs,ls", spectra.lags, inverse, spectra.lags))
    # an autocorrelation's lag and its opposite are one: half of the mean over the frequencies
    size, flat = len(who) * between.shape[2], (len(between), *([1] * (shares.ndim - 1)))
    weight = 0.5 * np.einsum("rs,xr,zs->xzrs", inverse, who, who)
    gram = np.einsum("xzrs,mrbsd->mxbzd", weight, between, optimize=True)
    right = 0.5 * np.einsum("rs,xr,mrbs->mxb", inverse, who, towards, optimize=True)
    scale = np.repeat(shares, between.shape[2], axis=-1)
    inner = scale[..., :, None] * gram.reshape(*flat, size, size) * scale[..., None, :]
    inner += np.eye(size)
    vector = (scale * right.reshape(*flat, size))[..., None]
    gain = (vector * np.linalg.solve(inner, vector)).sum(axis=(-2, -1))
    return np.asarray(alone + 0.5 * (gain - np.linalg.slogdet(inner)[1]))


def _recorded(
    ws: Workspace, model: Model, nominal: NoiseModel
) -> tuple[list[NoiseModel], list[Field]]:
    """Measure the noise of each recording; how the part lay turned in it."""
    each = off_edges(ws, model)
    return [one.noise(nominal) for one in each], [_turn(one.patches[0]) for one in each]


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


def stretched(noise: NoiseModel) -> Field:
    """Logarithm of the longest over the shortest correlation length, as twice the direction, (2,).

    By the second moments M of the positive autocorrelation, a reading's own size added: with
    L = ln M, s = ((L_xx - L_yy) / 2, L_xy).
    """
    ly, lx = noise.lags
    weight = np.where(noise.acf > SETTINGS.claims.lay_correlated, noise.acf, 0.0)
    weight /= weight.sum()
    down, right = np.mgrid[-ly : ly + 1, -lx : lx + 1]
    steps = np.stack([right * noise.pitch_x_mm, down * noise.pitch_y_mm])
    own = np.diag([noise.pitch_x_mm**2, noise.pitch_y_mm**2]) / 12
    values, vectors = np.linalg.eigh(np.einsum("nm,inm,jnm->ij", weight, steps, steps) + own)
    log = vectors @ np.diag(np.log(values)) @ vectors.T
    return np.array([0.5 * (log[0, 0] - log[1, 1]), log[0, 1]])
