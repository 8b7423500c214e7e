"""Form removal before roughness is taken: line, plane, and the Gaussian filter of ISO 16610-21.

Missing readings (NaN) weigh nothing everywhere and stay missing.
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

GAUSSIAN_ALPHA = math.sqrt(math.log(2.0) / math.pi)
"""Width constant of the Gaussian filter: 50 % transmission at the cut-off (ISO 16610-21, 4.2)."""


def remove_line(heights_mm: Floats) -> Floats:
    """Subtract each profile's least-squares line; (n, m) array, NaN-tolerant."""
    heights_mm = np.atleast_2d(heights_mm)
    valid = np.isfinite(heights_mm)
    x = np.arange(heights_mm.shape[1], dtype=np.float64)
    count = np.maximum(valid.sum(axis=1), 1)
    values = np.where(valid, heights_mm, 0.0)
    x_mean = (valid @ x) / count
    z_mean = values.sum(axis=1) / count
    x_centred = np.where(valid, x[None, :] - x_mean[:, None], 0.0)
    spread = np.sum(x_centred * x_centred, axis=1)
    slope = np.sum(x_centred * values, axis=1) / np.where(spread > 0.0, spread, 1.0)
    line = z_mean[:, None] + slope[:, None] * (x[None, :] - x_mean[:, None])
    return np.asarray(heights_mm - line)


def remove_plane(heights_mm: Floats) -> Floats:
    """Subtract the least-squares plane of the whole scan; (n, m) array, NaN-tolerant.

    Raises
    ------
    ValueError
        Where the valid points don't span a plane.
    """
    heights_mm = np.atleast_2d(heights_mm)
    valid = np.isfinite(heights_mm)
    row = np.arange(heights_mm.shape[0], dtype=np.float64)[:, None]
    column = np.arange(heights_mm.shape[1], dtype=np.float64)[None, :]
    ones = np.ones(heights_mm.shape)
    design = np.stack((ones[valid], (row * ones)[valid], (column * ones)[valid]), axis=1)
    solution, _, rank, _ = np.linalg.lstsq(design, heights_mm[valid], rcond=None)
    if rank < 3:
        raise ValueError("the valid points don't span a plane")
    return np.asarray(heights_mm - solution[0] - solution[1] * row - solution[2] * column)


def waviness(heights_mm: Floats, pitch_mm: float, cutoff_mm: float, axis: int = -1) -> Floats:
    """Mean line of the Gaussian filter, ISO 16610-21, with 50 % transmission at the cut-off.

    Parameters
    ----------
    heights_mm : (n, m) array
        Profiles; NaN where missing.
    pitch_mm, cutoff_mm : float
        Distance of the points along `axis` and cut-off wavelength λc, mm.
    axis : int
        Direction of the filter; the last for the usual profile filter.

    Returns
    -------
    (n, m) array
        The weighted mean within a cut-off to both sides. At ends and gaps the weights of what is
        there are normalised (ISO 16610-21, annex on end effects), so that nothing is cut off.
    """
    from scipy.signal import oaconvolve  # slow to load, and scans are generated without

    heights_mm = np.atleast_2d(np.asarray(heights_mm, dtype=np.float64))
    reach = math.ceil(cutoff_mm / pitch_mm)
    offsets = np.arange(-reach, reach + 1) * pitch_mm / (GAUSSIAN_ALPHA * cutoff_mm)
    weights = np.exp(-math.pi * offsets**2)
    weights /= weights.sum()
    valid = np.isfinite(heights_mm)
    weights = np.expand_dims(weights, 1 if axis == 0 else 0)
    total = oaconvolve(np.where(valid, heights_mm, 0.0), weights, mode="full", axes=axis)
    weight = oaconvolve(valid.astype(np.float64), weights, mode="full", axes=axis)
    # "same" would follow the longer of the two, which on a short profile is the filter
    here = np.arange(reach, reach + heights_mm.shape[axis])
    total, weight = np.take(total, here, axis=axis), np.take(weight, here, axis=axis)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(weight > 1e-9, total / weight, np.nan))


def remove_form(
    heights_mm: Floats, pitch_x_mm: float, cutoff_mm: float | None = None, form: str = "line"
) -> Floats:
    """Take form out of a scan's profiles.

    Parameters
    ----------
    heights_mm : (n, m) array
        Readings, one row a profile.
    pitch_x_mm : float
        Distance of the points along the profile, mm.
    cutoff_mm : float, optional
        Cut-off λc of the Gaussian filter along the profile; without it no filter is used.
    form : "line", "plane" or "none"
        What is fitted and subtracted before the filter.
    """
    if form not in ("line", "plane", "none"):
        raise ValueError(f"form is line, plane or none, not {form}")
    if form == "line":
        heights_mm = remove_line(heights_mm)
    elif form == "plane":
        heights_mm = remove_plane(heights_mm)
    if cutoff_mm is not None:
        heights_mm = heights_mm - waviness(heights_mm, pitch_x_mm, cutoff_mm)
    return np.atleast_2d(np.asarray(heights_mm, dtype=np.float64))
