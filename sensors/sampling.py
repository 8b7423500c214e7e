"""A draw of readings from a law: speckle, uncertainty, outliers, dropouts, rounding."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sensors.noise.lay import sample_lay
from sensors.noise.perlin import grid_pitch
from sensors.noise.uncertainty import quantise
from sensors.view.view import Reason, View

if TYPE_CHECKING:
    from sensors.law import Law, RngOf

Floats = NDArray[np.float64]

# Points drawn at a time, so that temporaries stay in the processor's cache.
BLOCK_POINTS = 1 << 16


def sample(law: "Law", rng_of: "RngOf", view: View) -> tuple[Floats, NDArray[np.uint8]]:
    """Draw one scan; see `Law.sample`.

    Each stream is used row by row, so that a draw doesn't depend on how rows are grouped.
    """
    depth = speckle_of(law, rng_of, view)
    if depth is None:
        depth = np.empty(law.shape)
        depth[...] = law.mean_mm
    else:
        depth += law.mean_mm
    reason = law.reason.copy()
    white = rng_of("uncertainty") if np.any(law.white_sd_mm) else None
    outliers = rng_of("outliers") if np.any(law.p_outlier) else None
    dropout = rng_of("dropout") if np.any(law.p_missing) else None
    patches = None
    if dropout is not None and law.missing_patch_mm > 0:
        patches = _patches(law.missing_patch_mm, dropout, view)
    n, m = law.shape
    rows = max(1, BLOCK_POINTS // max(1, m))
    sheet = view.datasheet
    for start in range(0, n, rows):
        part = slice(start, min(start + rows, n))
        block, why = depth[part], reason[part]
        if white is not None:
            noise = white.standard_normal(block.shape)
            noise *= _rows(law.white_sd_mm, part, n)
            block += noise
        if outliers is not None:
            chance, spike = outliers.random(block.shape), outliers.standard_normal(block.shape)
            spike *= _rows(law.outlier_sd_mm, part, n)
            block += np.where(chance < _rows(law.p_outlier, part, n), spike, 0.0)
        if law.step_mm:
            quantise(block, law.step_mm, out=block)
        beyond = (block < sheet.depth_min_mm) | (block > sheet.depth_max_mm)
        if beyond.any():
            block[beyond] = np.nan
            why[beyond] = Reason.OUT_OF_RANGE
        if dropout is not None:
            chance = dropout.random(block.shape) if patches is None else patches[part]
            lost = (chance < _rows(law.p_missing, part, n)) & (why == Reason.VALID)
            block[lost] = np.nan
            why[lost] = Reason.DROPOUT
    return depth, reason


def speckle_of(law: "Law", rng_of: "RngOf", view: View) -> Floats | None:
    """Draw the law's speckle, (n, m) mm; None without any."""
    if law.speckle is None:
        return None
    x_mm, y_mm, rng = view.column_x_mm, view.travel_mm, rng_of("speckle")
    if law.lay_ratio == 1.0:
        speckle = law.speckle.sample(x_mm, y_mm, rng)
    else:
        speckle = sample_lay(law.speckle, x_mm, y_mm, law.lay_ratio, law.lay_angle_rad, rng)
    if isinstance(law.speckle_gain, np.ndarray) or law.speckle_gain != 1.0:
        speckle *= law.speckle_gain
    return speckle


def _rows(value: Floats | float, part: slice, n: int) -> Floats | float:
    """Cut the rows `part` out of what broadcasts to n rows."""
    if isinstance(value, np.ndarray) and value.ndim == 2 and len(value) == n:
        return value[part]
    return value


def _patches(patch_mm: float, rng: np.random.Generator, view: View) -> Floats:
    """Uniform numbers, (n, m), alike within patches of about `patch_mm`.

    White Gaussian noise smoothed by a Gaussian of that full width at half maximum, standardised,
    put through its distribution function.
    """
    from scipy.ndimage import gaussian_filter
    from scipy.special import ndtr

    fwhm = patch_mm / math.sqrt(8 * math.log(2))
    pitch = (grid_pitch(view.travel_mm), grid_pitch(view.column_x_mm))
    sigma = [fwhm / p if p > 0 else 0.0 for p in pitch]
    noise = gaussian_filter(rng.standard_normal(view.shape), sigma, mode="wrap", truncate=5.0)
    kernel = np.zeros(view.shape)
    kernel[0, 0] = 1.0
    weight = gaussian_filter(kernel, sigma, mode="wrap", truncate=5.0)
    return np.asarray(ndtr(noise / math.sqrt(float(np.sum(weight * weight)))))
