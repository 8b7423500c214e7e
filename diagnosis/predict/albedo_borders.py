"""Borders of the albedo: where a reading depends on how wide the line is."""

import numpy as np
from scipy.ndimage import binary_dilation

from diagnosis.fields import Mask
from sensors.view.view import View

BORDER = 0.15
"""Step of the brightness's logarithm between profiles that is a border of the albedo."""
BORDER_REACH = 2
"""Profiles to each side of a border that a line reaches over, as beside depth edges."""


def albedo_borders(view: View) -> Mask:
    """Mark readings within reach of a border between bright and dark, (n, m).

    What a line reads there depends on how wide it is: no place to measure noise.
    """
    bright = view.intensity
    if bright is None:
        return np.zeros(view.shape, dtype=bool)
    known = np.isfinite(bright) & (bright > 0)
    log = np.log(np.where(known, bright, 1.0))
    step = np.zeros(view.shape, dtype=bool)
    jump = (np.abs(np.diff(log, axis=0)) > BORDER) & known[1:] & known[:-1]
    step[1:] |= jump
    step[:-1] |= jump
    return np.asarray(binary_dilation(step, np.ones((2 * BORDER_REACH + 1, 1), dtype=bool)))
