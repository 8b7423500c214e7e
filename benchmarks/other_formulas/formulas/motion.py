"""Errors of time and travel: slips, vibration, drift, exposure on the way."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.other_formulas.formulas.base import Formula, shared
from benchmarks.other_formulas.instrument import PITCH_MM
from benchmarks.other_formulas.shot import Shot

Floats = NDArray[np.float64]


def slipped(shot: Shot, slip_mm: Floats) -> Shot:
    """Take each profile displaced along the travel by slip_mm (n,)."""
    return replace(shot, mean=shot.mean + shot.view.cast(dy=slip_mm) - shot.view.depth)


def _travel(shot: Shot) -> Floats:
    return np.arange(shot.view.shape[0]) * PITCH_MM


def stick_slip(shot: Shot, size: float, seed: int) -> Shot:
    """Stick and slip: the table lags more and more, then jumps back, each few millimetres."""
    rng = shared(seed, shot.index)
    period = float(shared(seed).uniform(3.0, 6.0))
    return slipped(shot, 0.06 * size * (np.mod(_travel(shot) / period + rng.uniform(), 1) - 0.5))


def cycloid_screw(shot: Shot, size: float, seed: int) -> Shot:
    """Bent screw with play: |sin| instead of a sine."""
    rng = shared(seed, shot.index)
    period = float(shared(seed).uniform(3.0, 6.0))
    wave = np.abs(np.sin(np.pi * (_travel(shot) / period + rng.uniform())))
    return slipped(shot, 0.06 * size * (wave - 2 / np.pi))


def square_shake(shot: Shot, size: float, seed: int) -> Shot:
    """Knock the frame to and fro by a valve: a square wave."""
    rng = shared(seed, shot.index)
    cycles = float(shared(seed).uniform(0.06, 0.3))
    wave = np.sign(np.sin(2 * np.pi * (cycles * np.arange(shot.view.shape[0]) + rng.uniform())))
    return shot.plus(0.003 * size * np.broadcast_to(wave[:, None], shot.view.shape))


def ringing(shot: Shot, size: float, seed: int) -> Shot:
    """Knocks that ring down: damped sines, a few in each recording."""
    rng = shared(seed, shot.index)
    cycles, t = float(shared(seed).uniform(0.08, 0.3)), np.arange(shot.view.shape[0])
    wave = np.zeros(len(t))
    for start in rng.uniform(-10, 100, 5):
        after = np.maximum(t - start, 0.0)
        wave += np.where(t > start, np.exp(-after / 25.0) * np.sin(2 * np.pi * cycles * after), 0)
    return shot.plus(0.006 * size * np.broadcast_to(wave[:, None], shot.view.shape))


def _clock(shot: Shot) -> Floats:
    return np.asarray(shot.view.scan.start_s + shot.view.scan.time_s)


def two_constants(shot: Shot, size: float, seed: int) -> Shot:
    """Warming up with two time constants of opposite sign: head first, then the frame."""
    t, sign = _clock(shot), shared(seed).choice([-1, 1])
    drift = 1.6 * (1 - np.exp(-t / 60.0)) - 0.9 * (1 - np.exp(-t / 300.0))
    return shot.plus(0.03 * sign * size * np.broadcast_to(drift[:, None], shot.view.shape))


def root_drift(shot: Shot, size: float, seed: int) -> Shot:
    """Heat that diffuses into a half-space: the square root of time."""
    t, sign = _clock(shot), shared(seed).choice([-1, 1])
    return shot.plus(0.003 * sign * size * np.broadcast_to(np.sqrt(t)[:, None], shot.view.shape))


def _exposed(shot: Shot, way_mm: Floats, weight: Floats) -> Shot:
    """Average what the line sees on its way; light of the two levels of a step merges."""
    seen = np.stack([shot.view.cast(dy=float(w)) for w in way_mm])
    w = weight[:, None, None] * np.isfinite(seen)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(w * np.nan_to_num(seen), 0) / w.sum(0)
    return replace(shot, mean=shot.mean + mean - shot.view.depth)


def trapezoid_blur(shot: Shot, size: float, _seed: int) -> Shot:
    """Shutter that opens and closes: a trapezoid of light over the way, starting at the pose."""
    u = (np.arange(13) + 0.5) / 13
    weight = np.minimum(1.0, np.minimum(u, 1 - u) / 0.3)
    return _exposed(shot, 0.5 * size * u, weight)


def decaying_blur(shot: Shot, size: float, _seed: int) -> Shot:
    """Phosphor-like chip lag: exponential over the way, the light before the pose."""
    u = (np.arange(13) + 0.5) / 13
    return _exposed(shot, -0.6 * size * u, np.exp(-2.0 * u))


FORMULAS = (
    Formula(name="stick-slip", effect="travel_ripple", apply=stick_slip),
    Formula(name="cycloid screw", effect="travel_ripple", apply=cycloid_screw),
    Formula(name="square shake", effect="stage_vibration", apply=square_shake),
    Formula(name="ringing knocks", effect="stage_vibration", apply=ringing),
    Formula(name="two time constants", effect="thermal_drift", apply=two_constants, slow=True),
    Formula(name="root of time", effect="thermal_drift", apply=root_drift, slow=True),
    Formula(name="trapezoid exposure", effect="motion_blur", apply=trapezoid_blur,
            parts=("terraces", "ribs", "grooves")),
    Formula(name="decaying exposure", effect="motion_blur", apply=decaying_blur,
            parts=("terraces", "ribs", "grooves")),
)  # fmt: skip
