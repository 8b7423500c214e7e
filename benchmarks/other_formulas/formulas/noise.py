"""Noise, outliers, losses and the part's own form by other distributions and shapes."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.other_formulas.formulas.base import Formula, shared
from benchmarks.other_formulas.shot import Shot
from benchmarks.other_formulas.speckle import Noise, speckle_kernel, unit

Floats = NDArray[np.float64]


def disc_clumps(shot: Shot, size: float, _seed: int) -> Shot:
    """Lose readings in round clumps of a few readings (dust)."""
    v, u = np.mgrid[-3:4, -3:4]
    clump = unit(((u**2 + v**2) <= 6).astype(float))
    return replace(shot, clump=clump, p_missing=np.minimum(shot.p_missing + 0.02 * size, 0.9))


def run_clumps(shot: Shot, size: float, _seed: int) -> Shot:
    """Lose readings in runs along the line (a chip that misses whole stretches)."""
    clump = unit(np.exp(-0.5 * (np.arange(-6, 7) / 2.0) ** 2)[None])
    return replace(shot, clump=clump, p_missing=np.minimum(shot.p_missing + 0.02 * size, 0.9))


def lognormal_outliers(shot: Shot, size: float, _seed: int) -> Shot:
    """Outliers of lognormal size and either sign: median 0.12 mm, spread factor 2."""

    def sizes(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
        return rng.choice([-1.0, 1.0], shape) * 0.12 * np.exp(0.7 * rng.standard_normal(shape))

    return replace(shot, p_outlier=min(0.004 * size, 0.3), outlier=sizes)


def uniform_outliers(shot: Shot, size: float, _seed: int) -> Shot:
    """Outliers anywhere within ±3 mm (stray light)."""

    def sizes(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
        return rng.uniform(-3, 3, shape)

    return replace(shot, p_outlier=min(0.004 * size, 0.3), outlier=sizes)


def louder(shot: Shot, size: float, _seed: int) -> Shot:
    """Speckle louder while the independent share stays: its variance times (1 + size / 2)."""
    more = shot.noise.share * 0.5 * size
    share = (shot.noise.share + more) / (1 + more)
    noise = Noise(kernel=shot.noise.kernel, share=share)
    return replace(shot, noise=noise, scale=shot.scale * np.sqrt(1 + more))


def gamma_patches(shot: Shot, size: float, seed: int) -> Shot:
    """Rougher by patches of the part: log sd with a mean and a smooth part of a third of it."""
    rng = shared(seed)
    k, phase = rng.normal(0, 0.25, (6, 2)), rng.uniform(0, 2 * np.pi, 6)
    wave = np.cos(np.einsum("nmi,ki->nmk", shot.view.points[..., :2], k) + phase).sum(-1)
    return replace(
        shot, scale=shot.scale * np.exp(0.15 * size * (1 + wave / 3 / np.sqrt(3)))
    )


def _lay(shot: Shot, ratio: float, angle_part: float) -> Floats:
    """Kernel of a lay along a direction of the part, as this scan's grid sees it."""
    pose = shot.view.scan.true_poses[0, :3, :3]
    way = pose.T @ np.array([np.cos(angle_part), np.sin(angle_part), 0.0])
    angle = float(np.arctan2(_towards(shot) * way[1], way[0]))
    return speckle_kernel(1.0, 0.0, ratio=ratio, angle_rad=angle, pitches=_pitches(shot))


def _towards(shot: Shot) -> float:
    """Sign of the travel along the sensor's y."""
    poses = shot.view.scan.poses
    return float(np.sign((poses[-1, :3, 3] - poses[0, :3, 3]) @ poses[0, :3, 1]))


def _pitches(shot: Shot) -> tuple[float, float]:
    """Pitches along the line and the travel, over their geometric mean."""
    places = shot.view.scan.poses[:, :3, 3]
    one = float(np.median(np.abs(np.diff(shot.view.x, axis=1))))
    two = float(np.median(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    mean = float(np.sqrt(one * two))
    return one / mean, two / mean


def elliptic_lay(shot: Shot, size: float, seed: int) -> Shot:
    """Ground surface: the speckle drawn out along a direction of the part by a Gaussian ellipse."""
    angle = float(shared(seed).uniform(0, np.pi))
    mixed = min(1.0, 0.5 * size)
    drawn = _lay(shot, 5.0, angle)
    kernel = _beside(shot.noise.kernel, drawn, mixed)
    return replace(shot, noise=Noise(kernel=kernel, share=shot.noise.share))


def grooved_lay(shot: Shot, size: float, seed: int) -> Shot:
    """Turn the surface: a narrow band of waves across a direction of the part, random in phase."""
    angle = float(shared(seed).uniform(0, np.pi))
    kernel = _lay(shot, 7.0, angle)
    half, (px, py) = kernel.shape[0] // 2, _pitches(shot)
    v, u = np.mgrid[-half : half + 1, -half : half + 1]
    pose = shot.view.scan.true_poses[0, :3, :3]
    across = pose.T @ np.array([-np.sin(angle), np.cos(angle), 0.0])
    across[1] *= _towards(shot)
    wave = np.cos(2 * np.pi * (u * px * across[0] + v * py * across[1]) / 5.0)
    kernel = _beside(shot.noise.kernel, unit(kernel * wave), min(1.0, 0.5 * size))
    return replace(shot, noise=Noise(kernel=kernel, share=shot.noise.share))


def _beside(first: Floats, second: Floats, weight: float) -> Floats:
    """Kernel of a field and another independent one that has the share `weight` of its variance.

    Of all kernels with that spectrum the one of zero phase.
    """
    size = 2 * max(*first.shape, *second.shape) + 1
    one, two = (np.abs(np.fft.fft2(k, (size, size))) ** 2 for k in (first, second))
    power = (1 - weight) * one + weight * two
    return unit(np.fft.fftshift(np.fft.ifft2(np.sqrt(power)).real))


def dents(shot: Shot, size: float, seed: int) -> Shot:
    """Form error by a few wide Gaussian dents and bulges of the part."""
    rng, points = shared(seed), shot.view.points
    lift = np.zeros(shot.view.shape)
    for at, wide, high in zip(rng.uniform([-18, -14], [18, 14], (4, 2)), rng.uniform(8, 14, 4),
                              rng.normal(0, 1, 4), strict=True):  # fmt: skip
        lift += high * np.exp(-0.5 * ((points[..., :2] - at) ** 2).sum(-1) / (0.5 * wide) ** 2)
    return shot.plus(-0.01 * size * lift)


def cantilever(shot: Shot, size: float, seed: int) -> Shot:
    """Form error by a bending beam clamped at one side: u² (3 - u), and a twist."""
    turn = float(shared(seed).uniform(0, 2 * np.pi))
    p = shot.view.points
    u = np.clip((p[..., 0] * np.cos(turn) + p[..., 1] * np.sin(turn)) / 24 + 1, 0, 2.5)
    v = (p[..., 1] * np.cos(turn) - p[..., 0] * np.sin(turn)) / 20
    return shot.plus(-0.01 * size * (u**2 * (3 - u) + u * v))


FORMULAS = (
    Formula(name="round clumps", effect="random_dropout", apply=disc_clumps),
    Formula(name="runs along the line", effect="random_dropout", apply=run_clumps),
    Formula(name="lognormal outliers", effect="outlier_spikes", apply=lognormal_outliers),
    Formula(name="uniform outliers", effect="outlier_spikes", apply=uniform_outliers),
    Formula(name="louder speckle", effect="roughness_level", apply=louder, needs_plate=True),
    Formula(name="patches of roughness", effect="roughness_level", apply=gamma_patches,
            needs_plate=True),
    Formula(name="elliptic lay", effect="anisotropic_lay", apply=elliptic_lay, needs_plate=True),
    Formula(name="grooved lay", effect="anisotropic_lay", apply=grooved_lay, needs_plate=True),
    Formula(name="dents and bulges", effect="form_error", apply=dents),
    Formula(name="bending beam", effect="form_error", apply=cantilever),
)  # fmt: skip
