"""Autocorrelation and heights of the noise of a recorded plate, and the field that has them."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from sensors.noise.heights import HeightMap
from sensors.noise.measured_field import LAGS, MeasuredField, standardised
from sensors.noise.noise_target import QUANTILES
from sensors.noise.uncertainty import gaussian_sd_mm

Floats = NDArray[np.float64]

LEAST_SPECKLE = 0.02
"""Share of a plate's variance that is left to the speckle, at least, beside the sensor's own."""


def measured_field(
    flat_mm: Floats, pitch_x_mm: float, pitch_y_mm: float, *,
    resolution_mm: float, repeatability_mm: float = 0.0,
) -> MeasuredField:  # fmt: skip
    """Return the field whose simulated scans have a plate's autocovariance and heights.

    The sensor's own uncertainty (equation 10) and rounding, which every simulated scan adds, are
    subtracted from the variance.

    Parameters
    ----------
    flat_mm : (n, m) array
        Readings without form, NaN where missing.
    """
    covariance = autocovariance(flat_mm)
    middle = tuple(size // 2 for size in covariance.shape)
    total = float(covariance[middle])
    own = gaussian_sd_mm(resolution_mm, repeatability_mm) ** 2 + resolution_mm**2 / 12
    speckle = max(total - own, LEAST_SPECKLE * total)
    covariance[middle] = speckle
    valid = flat_mm[np.isfinite(flat_mm)]
    values = np.quantile(valid, QUANTILES) - valid.mean()
    values *= math.sqrt(speckle / total)
    knots = ndtri(QUANTILES)
    shape = HeightMap(knots=tuple(knots.tolist()), values=tuple(values.tolist()))
    correlation = standardised(np.clip(covariance / speckle, -1.0, 1.0), shape)
    field = MeasuredField(
        amplitude_mm=1.0, cell_x_mm=pitch_x_mm, cell_y_mm=pitch_y_mm, heights=shape,
        correlation=tuple(tuple(round(float(c), 4) for c in row) for row in correlation),
    )  # fmt: skip
    mean, sd = field.moments_mm()
    values = (values - mean) * math.sqrt(speckle) / sd
    heights = HeightMap(knots=shape.knots, values=tuple(float(f"{v:.6g}") for v in values))
    return MeasuredField(
        amplitude_mm=1.0, cell_x_mm=pitch_x_mm, cell_y_mm=pitch_y_mm, heights=heights,
        correlation=field.correlation,
    )  # fmt: skip


def autocovariance(flat_mm: Floats) -> Floats:
    """Autocovariance at lags of up to `LAGS` points and profiles, mm²; (2a + 1, 2b + 1).

    Means over pairs of valid readings, under a flat-top window that leaves the first half of the
    lags as measured (Politis and Romano, J. Time Series Anal. 16 (1995) 67).
    """
    valid = np.isfinite(flat_mm)
    centred = np.where(valid, flat_mm - flat_mm[valid].mean(), 0.0)
    shape = [size + 2 * LAGS for size in flat_mm.shape]

    def products(values: Floats) -> Floats:
        power = np.abs(np.fft.rfft2(values, shape)) ** 2
        return np.asarray(np.fft.irfft2(power, shape))

    most = [min(LAGS, size - 1) for size in flat_mm.shape]
    lags = [np.arange(-k, k + 1) for k in most]
    at = np.ix_(*lags)
    pairs = np.maximum(np.round(products(valid.astype(np.float64))[at]), 1.0)
    window = [np.clip(2.0 - 2.0 * np.abs(lag) / (LAGS + 1), 0.0, 1.0) for lag in lags]
    return np.asarray(products(centred)[at] / pairs * np.outer(*window))
