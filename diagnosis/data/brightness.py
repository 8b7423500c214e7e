"""Brightness without speckle: the part of an intensity image that belongs to the surface.

Speckle moves a reading's depth and its brightness together, so a raw intensity image explains
part of the noise. Two parts are kept: the mean of all surfaces of one direction, and changes over
several readings that exceed speckle (albedo patterns, stains, shading).
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt, median_filter

from diagnosis.fields import Field, Mask, median_sd
from diagnosis.settings import SETTINGS
from sensors.view.view import View

NARROW, WIDE = 5, 15
WINDOWS = (NARROW, 3, 1)
"""Windows of medians, readings; the narrowest that is clear of speckle counts."""
BIN_DEG = 3.0
"""Directions of the surface that count as one."""
SIDE = int(180 / BIN_DEG) + 1
CHUNK = 450_000
"""Points that are looked at together."""


def by_direction(intensity: Field, view: View) -> Field:
    """Brightness that surfaces of a direction have on average, (n, m); 1 where nothing is hit.

    It changes at a crease as the surface does, without a filter's blur.
    """
    n, m = intensity.shape
    rows = max(1, CHUNK // m)
    parts = [slice(start, min(start + rows, n)) for start in range(0, n, rows)]
    place = np.concatenate([_direction(view.rows(part)) for part in parts])
    lit = (place >= 0) & np.isfinite(intensity) & (intensity > 0)
    count = np.bincount(place[lit], minlength=SIDE**2).reshape(SIDE, SIDE)
    total = np.bincount(place[lit], np.log(intensity[lit]), SIDE**2).reshape(SIDE, SIDE)
    known = count >= SETTINGS.data.direction_readings
    if not known.any():
        return np.ones(intensity.shape)
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    table = np.exp((total / np.maximum(count, 1))[tuple(nearest)])
    return np.asarray(np.append(table.ravel(), 1.0)[place])


def _direction(view: View) -> NDArray[np.int32]:
    """Give each surface the number of its direction, (n, m); -1 where nothing is hit."""
    steps = [(np.degrees(np.arctan(s)) + 90) / BIN_DEG for s in (view.slope_y, view.slope_x)]
    known = np.isfinite(steps[0]) & np.isfinite(steps[1])
    a, b = (np.rint(np.where(known, s, 0.0)).astype(np.int32) for s in steps)
    return np.where(known, a * SIDE + b, -1)


def surface_brightness(intensity: Field, view: View) -> Field:
    """Return the surface's part of an intensity image, (n, m), same unit; NaN where missing.

    The mean of a direction describes a part of one albedo. On a part with an albedo pattern the
    mean only states how much of the pattern lies there.

    Parameters
    ----------
    intensity : (n, m) as recorded
    view : the part at the placement of the recording
    """
    usual = by_direction(intensity, view)
    rest = smoothed_brightness(intensity / usual)
    log = np.log(rest[np.isfinite(rest) & (rest > 0)])
    if log.size and np.std(log) < SETTINGS.data.one_albedo:
        return rest * usual
    return smoothed_brightness(intensity)


def smoothed_brightness(intensity: Field) -> Field:
    """Return what stands clear of speckle, (n, m), same unit; NaN where missing.

    Medians keep steps, but lose features narrower than half their window. The logarithm is taken
    as read, else from a narrow median, where that differs from a wide median by `speckle_sd`
    deviations of the speckle in it; from the wide median elsewhere.
    """
    known = np.isfinite(intensity) & (intensity > 0)
    if known.sum() < 4 * NARROW**2:
        return intensity
    log = np.log(np.where(known, intensity, 1.0))
    filled = np.where(known, log, np.median(log[known]))
    wide = _median(filled, WIDE)
    out = wide
    for width in WINDOWS:
        middle = filled if width == 1 else _median(filled, width)
        speckle = max(_speckle(middle, known, max(width, 2)), 1e-6)
        clear = np.abs(middle - wide) > SETTINGS.data.speckle_sd * speckle
        out = np.where(binary_dilation(clear, iterations=2), middle, out)
    return np.where(known, np.exp(out), np.nan)


def _speckle(log: Field, known: Mask, lag: int) -> float:
    """Return the scatter of a logarithm from differences of readings that share no window."""
    apart = [
        (log[lag:] - log[:-lag])[known[lag:] & known[:-lag]],
        (log[:, lag:] - log[:, :-lag])[known[:, lag:] & known[:, :-lag]],
    ]
    return median_sd(np.concatenate(apart)) / math.sqrt(2)


def _median(field: Field, width: int) -> Field:
    """Median along the rows, then along the columns."""
    along = median_filter(field, (1, width), mode="nearest")
    return np.asarray(median_filter(along, (width, 1), mode="nearest"))
