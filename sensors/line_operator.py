"""A laser line of finite width, located by its centre of gravity: one operator, many effects.

    z_m(y) = Σ_η L(η) I(y+η) V(y+η) [z(y+η) + κ η cot θ] / Σ_η L I V

L the line's Gaussian profile, I the radiance towards the camera, V its visibility. The part is
cast again at each displaced sub-line: nothing is linearised, since these effects live at edges.
Sub-lines whose depth runs on without a jump from the centre's belong to its peak in the camera's
image; light from beyond a jump makes a second peak, which merges with the first where they are
closer than `merge_mm`, and otherwise wins if it is brighter.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensors.view import View

Floats = NDArray[np.float64]

SUB_LINES = 12
REACH = 3.0
"""Half width of the sampled profile in standard deviations."""

STEEPEST = 4.0
"""Depth rise over displacement beyond which neighbouring sub-lines count as a jump (76°)."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Line:
    """What the operator gives at each point, (n, m).

    Attributes
    ----------
    depth_mm : the reading; NaN where no light reaches the camera
    light : share of the line's light that reaches the camera, 0 to 1
    whole : where every sub-line is seen and belongs to one peak
    """

    depth_mm: Floats
    light: Floats
    whole: NDArray[np.bool_]


def sub_lines(sd_mm: float) -> Floats:
    """Displacements (k,) that sample a Gaussian profile: an even number, symmetric, mm.

    Scaled so that their weighted second moment is exactly sd², hence a parabola's bias is exact.
    """
    unit = (np.arange(SUB_LINES) + 0.5) * (2 * REACH / SUB_LINES) - REACH
    weight = np.exp(-0.5 * unit**2)
    return np.asarray(sd_mm * unit / math.sqrt(float(weight @ unit**2 / weight.sum())))


def gaussian_weights(offsets_mm: Floats, sd_mm: Floats | float) -> list[Floats | float]:
    """Weights of `sub_lines(max sd)` for a width that may change over the scan."""
    widest = float(np.nanmax(sd_mm))
    scale = offsets_mm.max() / (REACH * (1 - 1 / SUB_LINES)) / widest
    return [np.exp(-0.5 * np.square(eta / scale / sd_mm)) for eta in offsets_mm]


def line_sd_mm(view: View, line_sd_um: float | None, rayleigh_mm: float | None) -> Floats | float:
    """Return the standard deviation of the line, mm; (n, m) where it grows with defocus.

    The datasheet's 1/e² full width is four standard deviations. Away from the working distance
    it grows as sqrt(1 + ((z - WD) / rayleigh)²), a Gaussian beam's law.
    """
    if line_sd_um is None:
        line_sd_um = view.datasheet.require("line_width_um") / 4
    if not rayleigh_mm:
        return line_sd_um * 1e-3
    off = (view.depth_mm - view.datasheet.working_distance_mm) / rayleigh_mm
    return np.asarray(line_sd_um * 1e-3 * np.sqrt(1.0 + np.where(view.valid, off, 0.0) ** 2))


def read_line(
    view: View,
    offsets_mm: Floats,
    weights: list[Floats | float],
    *,
    axis: str = "y",
    camera: bool = False,
    visible: bool = False,
    brightness: bool = False,
    merge_mm: float | None = None,
) -> Line:
    """Apply the operator.

    Parameters
    ----------
    view : View
        The scan; sub-lines are its shifted views.
    offsets_mm : (k,) or (k, n) array
        Displacements of the sub-lines, each side in rising distance from the centre once sorted;
        one for all profiles or one for each.
    weights : k floats or (n, m) arrays
        L of each, in the order of `offsets_mm`.
    axis : "x" or "y"
        Along which they are displaced.
    camera : bool
        Add κ η cot θ, cot θ = z / b: light off the laser's plane reads deeper. Needs an angle.
    visible : bool
        Light that the camera can't see doesn't count.
    brightness : bool
        Weigh by the surface's brightness.
    merge_mm : float or None
        Distance of two peaks' readings up to which they merge; None: the centre's peak alone.
    """
    offsets = offsets_mm if offsets_mm.ndim == 2 else offsets_mm[:, None]
    middle = offsets.mean(axis=1)
    lean = 1.0 / view.datasheet.camera_offset_mm if camera else 0.0
    zero = np.zeros(view.shape)
    own_light, own_sum, far_light, far_sum, total = (zero.copy() for _ in range(5))
    whole = view.valid.copy()
    for side in (middle >= 0, middle < 0):
        last_depth, last_offset, joined = view.depth_mm, np.zeros(1), view.valid
        for k in sorted(np.nonzero(side)[0], key=lambda i: abs(middle[i])):
            eta = offsets[k] if offsets.shape[1] > 1 else offsets[k, 0]
            sub = view.shifted(dy_mm=eta) if axis == "y" else view.shifted(dx_mm=eta)
            depth = sub.depth_mm
            gap = np.abs(offsets[k] - last_offset)[:, None]
            joined = joined & (np.abs(depth - last_depth) <= STEEPEST * gap)
            light = np.broadcast_to(np.asarray(weights[k], dtype=np.float64), view.shape)
            total += light
            counted = sub.visible if visible else sub.valid
            light = np.where(counted, light, 0.0)
            if brightness:
                light = light * _brightness(view, sub, offsets[k])
            reading = np.where(counted, depth, 0.0)
            reading = reading * (1.0 + lean * offsets[k][:, None])
            own_light += np.where(joined, light, 0.0)
            own_sum += np.where(joined, light * reading, 0.0)
            far_light += np.where(joined, 0.0, light)
            far_sum += np.where(joined, 0.0, light * reading)
            whole &= joined & counted
            last_depth, last_offset = depth, offsets[k]
    return _located(own_light, own_sum, far_light, far_sum, total, whole, merge_mm)


def _located(
    own_light: Floats,
    own_sum: Floats,
    far_light: Floats,
    far_sum: Floats,
    total: Floats,
    whole: NDArray[np.bool_],
    merge_mm: float | None,
) -> Line:
    with np.errstate(divide="ignore", invalid="ignore"):
        own = own_sum / own_light
        if merge_mm is None:
            return Line(depth_mm=own, light=own_light / total, whole=whole)
        far = far_sum / far_light
        both = (own_sum + far_sum) / (own_light + far_light)
        merged = ~(np.abs(own - far) > merge_mm)  # also where one of them has no light
        empty = own_light + far_light == 0
        depth = np.where(merged & ~empty, both, np.where(far_light > own_light, far, own))
        depth = np.where(own_light == 0, far, np.where(far_light == 0, own, depth))
    return Line(depth_mm=depth, light=(own_light + far_light) / total, whole=whole)


def _brightness(view: View, sub: View, offset_mm: Floats) -> Floats:
    """Brightness of a sub-line: the part's there, or a recording's rows interpolated."""
    if view.intensity is None:
        bright = sub.brightness
        return np.ones(1) if bright is None else np.where(sub.valid, bright, 0.0)
    step = view.travel_step_mm
    n = len(step)
    safe = np.where(step == 0.0, 1.0, step)
    row = np.clip(np.arange(n) + np.where(step == 0.0, 0.0, offset_mm / safe), 0, n - 1)
    low = np.minimum(row.astype(np.int64), max(n - 2, 0))
    high = np.minimum(low + 1, n - 1)
    share = (row - low)[:, None]
    bright = np.asarray(view.intensity, dtype=np.float64)
    bright = np.where(np.isfinite(bright), bright, 0.0)
    return np.asarray((1.0 - share) * bright[low] + share * bright[high])
