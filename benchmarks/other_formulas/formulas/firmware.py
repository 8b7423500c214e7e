"""What firmware and export do to readings, and how profiles are delivered, by other rules."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.other_formulas.formulas.base import Formula
from benchmarks.other_formulas.shot import Shot

Floats = NDArray[np.float64]


def median(shot: Shot, size: float, _seed: int) -> Shot:
    """Firmware that takes a median of 3 x 3 or more readings."""
    width = 3 if size < 1.5 else 5

    def smooth(depth: Floats, _rng: np.random.Generator) -> Floats:
        padded = np.pad(depth, width // 2, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, (width, width))
        out, seen = depth.copy(), np.isfinite(depth)
        out[seen] = np.nanmedian(windows[seen].reshape(-1, width * width), axis=1)
        return out

    return replace(shot, firmware=smooth)


def lag(shot: Shot, size: float, _seed: int) -> Shot:
    """Readout whose electronics lag along the line: first order, one-sided."""
    keep = min(0.4 * size, 0.9)

    def smear(depth: Floats, _rng: np.random.Generator) -> Floats:
        out = depth.copy()
        for j in range(1, depth.shape[1]):
            last = np.where(np.isfinite(out[:, j - 1]), out[:, j - 1], depth[:, j])
            out[:, j] = keep * last + (1 - keep) * depth[:, j]
        return out

    return replace(shot, firmware=smear)


def repeats(shot: Shot, size: float, _seed: int) -> Shot:
    """Lost frames: a profile that is delivered twice, a few in a hundred."""

    def repeat(depth: Floats, rng: np.random.Generator) -> Floats:
        out = depth.copy()
        for i in np.flatnonzero(rng.random(len(depth) - 1) < 0.06 * size) + 1:
            out[i] = out[i - 1]
        return out

    return replace(shot, firmware=repeat)


def stutter(shot: Shot, size: float, _seed: int) -> Shot:
    """Stuttering buffer: now and then the same profile for two to four times."""

    def repeat(depth: Floats, rng: np.random.Generator) -> Floats:
        out = depth.copy()
        for i in np.flatnonzero(rng.random(len(depth) - 4) < 0.025 * size) + 1:
            out[i : i + int(rng.integers(2, 4))] = out[i - 1]
        return out

    return replace(shot, firmware=repeat)


def truncated(shot: Shot, size: float, _seed: int) -> Shot:
    """Export that cuts digits off instead of rounding: steps of 40 µm times size."""
    step = 0.04 * size

    def cut(depth: Floats, _rng: np.random.Generator) -> Floats:
        return np.floor(depth / step) * step

    return replace(shot, firmware=cut)


def companded(shot: Shot, size: float, _seed: int) -> Shot:
    """Count on a reciprocal scale: the step grows with the range."""
    near = shot.view.instrument.sheet.working_distance_mm
    step = 0.04 * size

    def count(depth: Floats, _rng: np.random.Generator) -> Floats:
        scale = near**2 / step
        with np.errstate(invalid="ignore", divide="ignore"):
            return scale / np.round(scale / depth)

    return replace(shot, firmware=count)


FORMULAS = (
    Formula(name="firmware median", effect="onboard_filter", apply=median, scaled=False,
            needs_plate=True),
    Formula(name="lag along the line", effect="onboard_filter", apply=lag, scaled=False,
            needs_plate=True),
    Formula(name="repeated profiles", effect="row_repeat", apply=repeats, scaled=False),
    Formula(name="stuttering buffer", effect="row_repeat", apply=stutter, scaled=False),
    Formula(name="digits cut off", effect="axis_quantisation", apply=truncated, scaled=False),
    Formula(name="reciprocal counts", effect="axis_quantisation", apply=companded, scaled=False),
)  # fmt: skip
