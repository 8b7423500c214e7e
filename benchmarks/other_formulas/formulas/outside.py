"""Eight kinds of effect that no catalogue names."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from benchmarks.other_formulas.formulas.base import Formula, shared
from benchmarks.other_formulas.formulas.motion import slipped
from benchmarks.other_formulas.shot import Shot

Floats = NDArray[np.float64]


def shimmer(shot: Shot, size: float, seed: int) -> Shot:
    """Hot air: each profile bent by a smooth random wave of its own."""
    rng = shared(seed, 3, shot.index)
    wave = gaussian_filter(rng.standard_normal(shot.view.shape), (0.8, 22.0))
    return shot.plus(0.006 * size * wave / wave.std())


def hunting(shot: Shot, size: float, seed: int) -> Shot:
    """Exposure that hunts: noise larger in every other few profiles."""
    period = int(shared(seed).integers(4, 9))
    rows = np.arange(shot.view.shape[0]) % period < period // 2
    return replace(shot, scale=shot.scale * np.where(rows, 1 + 0.6 * size, 1.0)[:, None])


def jumps(shot: Shot, size: float, seed: int) -> Shot:
    """Lost counts: a few blocks of profiles read too deep by one and the same amount."""
    rng = shared(seed, 4, shot.index)
    rows = np.zeros(shot.view.shape[0])
    for start in rng.integers(5, 110, 3):
        rows[start : start + int(rng.integers(3, 9))] = 1.0
    return shot.plus(0.02 * size * np.broadcast_to(rows[:, None], shot.view.shape))


def window(shot: Shot, size: float, seed: int) -> Shot:
    """Scratch on the window: some columns lose readings and are noisy."""
    rng, m = shared(seed), shot.view.shape[1]
    columns = np.zeros(m)
    for at in rng.integers(10, m - 20, 2):
        columns[at : at + int(rng.integers(4, 9))] = 1.0
    return replace(
        shot, p_missing=np.clip(shot.p_missing + min(0.3 * size, 0.9) * columns, 0, 0.95),
        scale=shot.scale * (1 + 0.8 * size * columns),
    )  # fmt: skip


def ghost(shot: Shot, size: float, _seed: int) -> Shot:
    """Second reflection of the window: a share of readings, on one side of the line, 0.8 mm off."""
    u = np.linspace(0, 1, shot.view.shape[1])

    def sizes(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
        return np.full(shape, 0.8) + 0.01 * rng.standard_normal(shape)

    share = np.broadcast_to(np.where(u > 0.55, min(0.03 * size, 0.4), 0.0), shot.view.shape)
    return replace(shot, p_outlier=share, outlier=sizes)


def belt_slip(shot: Shot, size: float, seed: int) -> Shot:
    """Belt that slips once or twice in each recording: later profiles lie behind."""
    rng, t = shared(seed, 6, shot.index), np.arange(shot.view.shape[0])
    slip = np.zeros(len(t))
    for at in rng.integers(25, 95, 2):
        slip += np.where(t >= at, 0.25 * size * rng.uniform(0.6, 1.4), 0.0)
    return slipped(shot, slip - slip.mean())


def fringes(shot: Shot, size: float, seed: int) -> Shot:
    """Interference in the window: fringes aslant over line and range."""
    rng, view = shared(seed), shot.view
    kx, kz = rng.uniform(1.2, 2.5), rng.uniform(1.0, 3.0)
    wave = np.sin(kx * view.x + kz * np.nan_to_num(view.depth) + rng.uniform(0, 6))
    return shot.plus(0.006 * size * wave)


def sticking_bit(shot: Shot, size: float, seed: int) -> Shot:
    """Bit of the counter that sticks at one in a share of the readings."""
    step = float(shared(seed).uniform(0.3, 0.6))

    def stick(depth: Floats, rng: np.random.Generator) -> Floats:
        zero = np.mod(np.floor(np.nan_to_num(depth) / step), 2) == 0
        stuck = rng.random(depth.shape) < 0.03 * size
        return np.where(zero & stuck, depth + step, depth)

    return replace(shot, firmware=stick)


FORMULAS = (
    Formula(name="shimmering air", effect="", apply=shimmer),
    Formula(name="hunting exposure", effect="", apply=hunting),
    Formula(name="lost counts", effect="", apply=jumps),
    Formula(name="scratched window", effect="", apply=window),
    Formula(name="ghost of the window", effect="", apply=ghost),
    Formula(name="slipping belt", effect="", apply=belt_slip),
    Formula(name="fringes of the window", effect="", apply=fringes),
    Formula(name="sticking bit", effect="", apply=sticking_bit, scaled=False),
)  # fmt: skip
