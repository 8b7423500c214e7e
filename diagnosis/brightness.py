"""Brightness without speckle: what of an intensity image belongs to the surface.

Speckle moves a reading's depth and its brightness together, so a raw intensity image explains
part of the noise. What is left here changes over several readings and stands clear of speckle:
prints, stains, shading.
"""

import numpy as np
from scipy.ndimage import binary_dilation, median_filter

from diagnosis.noise import Field

NARROW, WIDE = 5, 15
CLEAR = 6.0
"""A change of brightness counts as the surface's beyond this many deviations of speckle."""


def surface_brightness(intensity: Field) -> Field:
    """Return the surface's part of an intensity image, (n, m), same unit; NaN where missing.

    Medians keep steps. A narrow median of the logarithm is taken where it stands out of a wide
    one by `CLEAR` deviations of what speckle leaves in it, the wide one elsewhere.
    """
    known = np.isfinite(intensity) & (intensity > 0)
    if known.sum() < 4 * NARROW**2:
        return intensity
    log = np.log(np.where(known, intensity, 1.0))
    filled = np.where(known, log, np.median(log[known]))
    middle, wide = _median(filled, NARROW), _median(filled, WIDE)
    # medians a window apart share no reading
    apart = [
        np.abs(middle[NARROW:] - middle[:-NARROW])[known[NARROW:] & known[:-NARROW]],
        np.abs(middle[:, NARROW:] - middle[:, :-NARROW])[known[:, NARROW:] & known[:, :-NARROW]],
    ]
    speckle = 1.4826 * float(np.median(np.concatenate(apart))) / np.sqrt(2)
    clear = binary_dilation(np.abs(middle - wide) > CLEAR * max(speckle, 1e-6), iterations=2)
    return np.where(known, np.exp(np.where(clear, middle, wide)), np.nan)


def _median(field: Field, width: int) -> Field:
    """Median along the rows, then along the columns."""
    along = median_filter(field, (1, width), mode="nearest")
    return np.asarray(median_filter(along, (width, 1), mode="nearest"))
