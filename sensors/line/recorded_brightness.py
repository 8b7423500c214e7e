"""Centroid bias of the line from the brightness that a recording gives.

A line of Gaussian profile reads the brightness I = L * A of an albedo A, and its centroid lies
σ² ∂y ln I off its middle, whatever A is: the derivative of a Gaussian is -y/σ² times it. Readings
lie a pitch apart, and a border may be sharper than that. Three neighbours are taken for those of a
gradient and one step that the line blurs,

    I(y) = I₀ + g y + ΔI Φ((y - y₀) / σ),

with the slope g that both sides share: the lesser one, 0 where they differ in sign (a slope
limiter: Roe, Ann. Rev. Fluid Mech. 18 (1986) 337). That is exact in a gradient, within 5 % at a
step of any place, and the central difference where the pitch is much less than the line's width.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.line.line_operator import REACH, gaussian_weights, read_line, sub_lines
from sensors.view.view import View

Floats = NDArray[np.float64]

HALVINGS = 30
"""Of the interval in which a step is looked for: to a billionth of the line's width."""


def recorded_bias_mm(view: View, sd_mm: Floats | float) -> Floats:
    """Bias of the line's centroid towards the brighter side, as the recording shows it, (n, m) mm.

    Light off the laser's plane reads deeper by z / b a millimetre, and on a slope its own depth is
    read. 0 where brightness isn't known on both sides, and where the line lies on two levels.

    Parameters
    ----------
    sd_mm : standard deviation of the line, one or (n, m)
    """
    assert view.intensity is not None
    offsets = sub_lines(float(np.max(sd_mm)))
    line = read_line(view, offsets, gaussian_weights(offsets, sd_mm))
    sd = np.ascontiguousarray(np.broadcast_to(sd_mm, view.shape), dtype=np.float64)
    bright = np.ascontiguousarray(view.intensity, dtype=np.float64)
    slope = _log_slope(bright, np.ascontiguousarray(view.travel_step_mm), sd)
    deeper = view.slope_y + view.depth_mm / view.datasheet.camera_offset_mm
    biased = line.whole & (line.light > 0)
    return np.where(biased, np.square(sd) * slope * np.where(biased, deeper, 0.0), 0.0)


@njit(cache=True)
def _log_slope(bright: Floats, steps: Floats, sd: Floats) -> Floats:
    """Return the derivative of ln(brightness) along y, (n, m) 1/mm; 0 where it isn't known."""
    n, m = bright.shape
    out = np.zeros((n, m))
    for i in range(1, n - 1):
        before, after = steps[i - 1], steps[i]
        if before * after <= 0.0:
            continue
        for j in range(m):
            last, here, following = bright[i - 1, j], bright[i, j], bright[i + 1, j]
            if not (last > 0.0 and here > 0.0 and following > 0.0):
                continue
            gradient = 0.0
            if 1 < i < n - 2 and bright[i - 2, j] > 0.0 and bright[i + 2, j] > 0.0:
                gradient = _lesser(
                    (last - bright[i - 2, j]) / steps[i - 2],
                    (bright[i + 2, j] - following) / steps[i + 1],
                )
            rise = following - last - gradient * (before + after)
            slope = gradient
            if rise != 0.0:
                share = min(max((here - last - gradient * before) / rise, 0.0), 1.0)
                steep = _steepness(share, abs(before) / sd[i, j], abs(after) / sd[i, j])
                slope += math.copysign(1.0, before) * rise * steep / sd[i, j]
            out[i, j] = slope / here
    return out


@njit(cache=True)
def _lesser(one: float, other: float) -> float:
    """Return the smaller of two slopes of one sign; 0 where their signs differ."""
    if not one * other > 0.0:
        return 0.0
    return one if abs(one) < abs(other) else other


@njit(cache=True)
def _steepness(share: float, a: float, b: float) -> float:
    """Slope at 0 of a blurred step that rises by 1 from -a to b, and by `share` up to 0.

    In deviations of the line. A step out of its reach isn't looked for.
    """
    low, high = -REACH, REACH
    for _ in range(HALVINGS):
        d = 0.5 * (low + high)
        if _between(d - a, d) > share * _between(d - a, d + b):
            high = d
        else:
            low = d
    d = 0.5 * (low + high)
    return math.exp(-0.5 * d * d) / math.sqrt(2 * math.pi) / _between(d - a, d + b)


@njit(cache=True)
def _between(low: float, high: float) -> float:
    """Share of a normal distribution between two deviations."""
    if low > 0.0:
        low, high = -high, -low
    return 0.5 * (math.erfc(-high / math.sqrt(2.0)) - math.erfc(-low / math.sqrt(2.0)))
