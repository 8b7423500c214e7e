"""Light that is spread over many camera rows: what lies below the peak finder's threshold.

A line lights a flat in one camera row, but a steep wall in many of them: as much light is too thin
there to be counted. With L_k the light of the line's parts, p_k where it is read and z_k its depth,
the image's brightness at part k, over that of a line that stands on a flat, is

    I_k = Σ_q L_q s / s_q exp(-(p_k - p_q)² / 2 s_q²)
    s_q² = s² (1 - w') + (h (∂z_q/∂y + w' s / σ))² / 2π
    z_m = Σ_k L_k w_k p_k / Σ_k L_k w_k,                 w_k = max(1 - t / I_k, 0)

s = σ cot θ the image of the line itself as a depth, h the parts' distance, w' the derivative of
<η>, t the threshold; the second sums run over the brightest part and those that join it without a
gap. What lies at one displacement left the line at places whose variance is σ² (1 - w').
Centre of gravity of what exceeds a threshold: Naidu & Fisher, "A comparative analysis of algorithms
for determining the peak position of a stripe to sub-pixel accuracy", BMVC 1991. That variance:
Robbins, "An empirical Bayes approach to statistics", 1956 (Tweedie's formula). The widths s_q are
our own step: a Gaussian as high as the box that a facet's slope draws.
"""

import math
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.line.lambertian_light import lambertian_light
from sensors.line.line_operator import Line, row_blocks
from sensors.line.line_spread import LineSpread
from sensors.view.view import View

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

REACH = 4.0
"""Deviations at which an image ends."""
LEAST = 0.05
"""Least width of an image, in images of the line: the camera's own."""
JOINED = 3.0
"""Widths of an image up to which its neighbours join it: between them it isn't dark."""
FLAT = 1.25
"""Spread of the readings, in images of the line, up to which all of it lies in one peak."""


def above_threshold(
    view: View, line: LineSpread, read: Line, *, least: float, merge_mm: float
) -> Line:
    """Leave out of a line's reading what is too thin to be seen.

    Parameters
    ----------
    line, read : the line and what is read of all its light
    least : threshold, as a share of the brightest row of a line that stands on a flat
    merge_mm : gap in depth over which what is bright enough makes one peak

    Raises
    ------
    RecipeError
        Where the datasheet doesn't state the triangulation angle.
    """
    if least == 0.0 or line.sd_mm == 0.0:
        return read
    depth_mm, spread_mm = read.depth_mm.copy(), read.spread_mm.copy()
    image = line.sd_mm * view.depth_mm / abs(view.datasheet.camera_offset_mm)
    with np.errstate(invalid="ignore"):
        split = read.spread_mm > FLAT * image
    parts = row_blocks(view.shape)
    for part in parts:
        rows, columns = np.nonzero(split[part])
        if rows.size:
            some = view if len(parts) == 1 else view.rows(part)
            here = part.start + rows
            of, own = here % line.light.shape[1], image[here, columns]
            mean, spread = _read(some, line, rows, columns, of, own, least, merge_mm)
            seen = np.isfinite(mean)
            depth_mm[here[seen], columns[seen]] = mean[seen]
            spread_mm[here[seen], columns[seen]] = spread[seen]
    return replace(read, depth_mm=depth_mm, spread_mm=spread_mm)


def _read(
    view: View,
    line: LineSpread,
    rows: Ints,
    columns: Ints,
    of: Ints,
    image: Floats,
    least: float,
    merge_mm: float,
) -> tuple[Floats, Floats]:
    """Read some points of a view; `of` are their columns in the line's arrays."""
    camera_mm = view.datasheet.camera_offset_mm
    shape = rows.size, len(line.offsets_mm)
    light, depth, slope = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for k, offset in enumerate(line.offsets_mm):
        part = view.shifted(dy_mm=float(offset))
        lit = part.visible_from(camera_mm)[rows, columns]
        light[:, k] = np.where(lit, line.light[k, of] * lambertian_light(part)[rows, columns], 0.0)
        depth[:, k] = np.where(lit, part.depth_mm[rows, columns], 0.0)
        slope[:, k] = np.where(lit, part.slope_y[rows, columns], 0.0)
    moves = np.clip(np.gradient(line.within_mm, line.step_mm, axis=0), 0.0, 1.0)[:, of].T
    own = image[:, None]
    run = line.step_mm * (slope + moves * depth / camera_mm)
    wide = np.hypot(own * np.sqrt(1.0 - moves), run / math.sqrt(2 * math.pi))
    reading = depth * (1.0 + line.within_mm[:, of].T / camera_mm)
    return _counted(light, reading, np.fmax(wide, LEAST * own), image, least, merge_mm)


@njit(cache=True)
def _counted(
    light: Floats, reading: Floats, wide: Floats, image: Floats, least: float, merge_mm: float
) -> tuple[Floats, Floats]:
    """Mean and standard deviation of the readings (p, k) of the brightest peak; NaN without one."""
    points, parts = light.shape
    mean, spread = np.full(points, np.nan), np.full(points, np.nan)
    bright = np.empty(parts)
    for p in range(points):
        order = np.argsort(reading[p])
        top = -1
        for i in range(parts):
            k = order[i]
            bright[k] = 0.0
            if light[p, k] <= 0.0:
                continue
            for q in range(parts):
                away = abs(reading[p, k] - reading[p, q])
                size = wide[p, q]
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
            last = reading[p, order[top]]
            while 0 <= i < parts:
                k = order[i]
                i += side
                if bright[k] <= least:
                    continue
                if abs(reading[p, k] - last) > max(merge_mm, JOINED * wide[p, k]):
                    break
                last = reading[p, k]
                counted = light[p, k] * (1.0 - least / bright[k])
                total += counted
                first += counted * reading[p, k]
                second += counted * reading[p, k] ** 2
        mean[p] = first / total
        spread[p] = math.sqrt(max(second / total - mean[p] ** 2, 0.0))
    return mean, spread
