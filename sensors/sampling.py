"""A draw from the law of a reading: speckle, uncertainty, outliers, dropouts, rounding."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sensors.lay import sample_lay
from sensors.perlin import grid_pitch
from sensors.uncertainty import quantise
from sensors.view import Reason, View

if TYPE_CHECKING:
    from sensors.law import Law, RngOf

Floats = NDArray[np.float64]
BLOCK_POINTS = 1 << 18


def sample(law: "Law", rng_of: "RngOf", view: View) -> tuple[Floats, NDArray[np.uint8]]:
    """Draw one scan; see `Law.sample`."""
    depth = _speckle(law, rng_of, view)
    depth = law.mean_mm.copy() if depth is None else np.add(depth, law.mean_mm, out=depth)
    if np.any(law.white_sd_mm):
        _add_white(depth, law.white_sd_mm, rng_of("uncertainty"))
    if np.any(law.p_outlier):
        rng = rng_of("outliers")
        where = np.nonzero(rng.random(depth.shape) < law.p_outlier)
        width = np.broadcast_to(law.outlier_sd_mm, depth.shape)[where]
        depth[where] += width * rng.standard_normal(where[0].size)
    reason = law.reason.copy()
    if np.any(law.p_missing):
        lost = _uniform(law.missing_patch_mm, rng_of("dropout"), view) < law.p_missing
        lost &= reason == Reason.VALID
        depth[lost] = np.nan
        reason[lost] = Reason.DROPOUT
    if law.step_mm:
        depth = quantise(depth, law.step_mm)
    sheet = view.datasheet
    beyond = (depth < sheet.depth_min_mm) | (depth > sheet.depth_max_mm)
    if beyond.any():
        depth[beyond] = np.nan
        reason[beyond] = Reason.OUT_OF_RANGE
    return depth, reason


def _speckle(law: "Law", rng_of: "RngOf", view: View) -> Floats | None:
    if law.speckle is None:
        return None
    x_mm, y_mm = view.column_x_mm, view.travel_mm
    rng = rng_of("speckle")
    if law.lay_ratio == 1.0:
        speckle = law.speckle.sample(x_mm, y_mm, rng)
    else:
        speckle = sample_lay(law.speckle, x_mm, y_mm, law.lay_ratio, law.lay_angle_rad, rng)
    if isinstance(law.speckle_gain, np.ndarray) or law.speckle_gain != 1.0:
        speckle *= law.speckle_gain
    return speckle


def _add_white(depth: Floats, sd_mm: Floats | float, rng: np.random.Generator) -> None:
    """Add independent Gaussian noise in place, some rows at a time."""
    rows = max(1, BLOCK_POINTS // max(1, depth.shape[1]))
    sd = np.broadcast_to(sd_mm, depth.shape) if isinstance(sd_mm, np.ndarray) else sd_mm
    for start in range(0, len(depth), rows):
        block = depth[start : start + rows]
        noise = rng.standard_normal(block.shape)
        noise *= sd[start : start + rows] if isinstance(sd, np.ndarray) else sd
        block += noise


def _uniform(patch_mm: float, rng: np.random.Generator, view: View) -> Floats:
    """Uniform numbers, (n, m), equal within patches of about `patch_mm`.

    White Gaussian noise smoothed by a Gaussian of that full width at half maximum, standardised,
    put through its distribution function.
    """
    if patch_mm == 0.0:
        return rng.random(view.shape)
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
