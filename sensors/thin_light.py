"""Light that is spread over many camera rows: what lies below the peak finder's threshold.

A moving line lights a flat in one camera row all the time, but runs down a steep wall through many
of them: as much light is too thin there to be counted. With L_k the light of the line's parts and
z_k their depths, the image's brightness where part k lies, over that of a line that stands on a
flat, is

    I_k = Σ_q L_q s / s_q exp(-(z_k - z_q)² / 2 s_q²),   s_q² = s² + (h ∂z_q/∂y)² / 12
    z_m = Σ_k L_k w_k z_k / Σ_k L_k w_k,                 w_k = max(1 - t / I_k, 0)

s = σ cot θ the image of the line itself as a depth, h the parts' distance, t the threshold; the
second sums run over the brightest part and those that join it without a gap.
Centre of gravity of what exceeds a threshold: Naidu & Fisher, "A comparative analysis of algorithms
for determining the peak position of a stripe to sub-pixel accuracy", BMVC 1991; the widths s_q are
our own step, of a facet's slope.
"""

import math
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.light import matt
from sensors.line_operator import Line
from sensors.smear import Smear
from sensors.view import View

Floats = NDArray[np.float64]

REACH = 4.0
"""Deviations at which an image ends."""
FLAT = 1.0
"""Spread of the depths, in images of the line, within which all of it lies in one peak."""


def above_threshold(
    view: View, line: Smear, read: Line, *, sd_mm: float, least: float, merge_mm: float
) -> Line:
    """Leave out of a moving line's reading what is too thin to be seen.

    Parameters
    ----------
    line, read : the line and what is read of all its light
    sd_mm : standard deviation of the line across its width
    least : threshold, as a share of the brightest row of a line that stands on a flat
    merge_mm : gap in depth over which what is bright enough makes one peak

    Raises
    ------
    RecipeError
        Where the datasheet doesn't state the triangulation angle.
    """
    camera_mm = view.datasheet.camera_offset_mm
    image = sd_mm * view.depth_mm / abs(camera_mm)
    with np.errstate(invalid="ignore"):
        rows, columns = np.nonzero(read.spread_mm > FLAT * image)
    if least == 0.0 or sd_mm == 0.0 or not rows.size:
        return read
    shape = rows.size, len(line.offsets_mm)
    light, depth, wide = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    of = rows % line.light.shape[1]
    for k, offset in enumerate(line.offsets_mm):
        part = view.shifted(dy_mm=float(offset))
        lit = part.visible_from(camera_mm)[rows, columns]
        light[:, k] = np.where(lit, line.light[k, of] * matt(part)[rows, columns], 0.0)
        depth[:, k] = np.where(lit, part.depth_mm[rows, columns], 0.0)
        wide[:, k] = np.where(lit, part.slope_y[rows, columns], 0.0)
    wide *= line.step_mm / math.sqrt(12.0)
    reading = depth * (1.0 + line.within_mm[:, of].T / camera_mm)
    mean, spread = _counted(light, depth, reading, wide, image[rows, columns], least, merge_mm)
    seen = np.isfinite(mean)
    depth_mm, spread_mm = read.depth_mm.copy(), read.spread_mm.copy()
    depth_mm[rows[seen], columns[seen]] = mean[seen]
    spread_mm[rows[seen], columns[seen]] = spread[seen]
    return replace(read, depth_mm=depth_mm, spread_mm=spread_mm)


@njit(cache=True)
def _counted(
    light: Floats,
    depth: Floats,
    reading: Floats,
    wide: Floats,
    image: Floats,
    least: float,
    merge_mm: float,
) -> tuple[Floats, Floats]:
    """Mean and standard deviation of the readings (p, k) of the brightest peak; NaN without one."""
    points, parts = light.shape
    mean, spread = np.full(points, np.nan), np.full(points, np.nan)
    bright = np.empty(parts)
    for p in range(points):
        order = np.argsort(depth[p])
        top = -1
        for i in range(parts):
            k = order[i]
            bright[k] = 0.0
            if light[p, k] <= 0.0:
                continue
            for q in range(parts):
                away = abs(depth[p, k] - depth[p, q])
                size = math.hypot(image[p], wide[p, q])
                if light[p, q] > 0.0 and away < REACH * size:
                    gauss = math.exp(-0.5 * (away / size) ** 2)
                    bright[k] += light[p, q] * image[p] / size * gauss
            if bright[k] > least and (top < 0 or bright[k] > bright[order[top]]):
                top = i
        if top < 0:
            continue
        total, first, second = 0.0, 0.0, 0.0
        for side in (-1, 1):
            i = top if side < 0 else top + 1
            last = depth[p, order[top]]
            while 0 <= i < parts:
                k = order[i]
                i += side
                if bright[k] <= least:
                    continue
                if abs(depth[p, k] - last) > merge_mm:
                    break
                last = depth[p, k]
                counted = light[p, k] * (1.0 - least / bright[k])
                total += counted
                first += counted * reading[p, k]
                second += counted * reading[p, k] ** 2
        mean[p] = first / total
        spread[p] = math.sqrt(max(second / total - mean[p] ** 2, 0.0))
    return mean, spread
