"""Ranges of covariates over which the functions of components are drawn."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.components.smooth import Ranges
from diagnosis.predict.cameras import possible_views
from diagnosis.settings import SETTINGS
from sensors.view.covariates import COVARIATES

if TYPE_CHECKING:
    from diagnosis.data.patch import Patch


def ranges_of(patches: Sequence["Patch"], names: Sequence[str]) -> Ranges:
    """Range of each covariate over the readings off edges, without its rare extremes.

    A few readings on a steep wall would leave one wave for all others.
    """
    out = {}
    for name in names:
        values = []
        for patch in patches:
            view = possible_views(patch.view, COVARIATES[name].needs)[0]
            value = np.broadcast_to(COVARIATES[name].values(view), patch.shape)
            value = value[patch.observed & ~patch.edge]
            values.append(value[np.isfinite(value)][::3])
        every = np.concatenate(values) if values else np.zeros(0)
        if every.size:
            least, low, high, most = np.quantile(every, [0.002, 0.02, 0.98, 0.998])
            beyond = SETTINGS.range_beyond * (high - low)
            low, high = max(low - beyond, least), min(high + beyond, most)
            if high > low:
                out[name] = (float(low), float(high))
    return out
