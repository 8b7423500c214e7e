"""Borders of the albedo: where a reading depends on how wide the line is."""

import numpy as np

from diagnosis.fields import Mask, widened
from diagnosis.settings import SETTINGS
from sensors.view.view import View


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
    jump = (np.abs(np.diff(log, axis=0)) > SETTINGS.predict.border_step) & known[1:] & known[:-1]
    step[1:] |= jump
    step[:-1] |= jump
    return widened(step, (SETTINGS.predict.border_reach, 0))
