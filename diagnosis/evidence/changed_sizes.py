"""Sizes that a change may have, given those that good instruments have.

Sizes lie on a grid, each twice the one before.
"""

import numpy as np

from diagnosis.fields import Field
from diagnosis.settings import SETTINGS


def usual(weights: Field) -> int:
    """Return the number of the size that most good instruments stay below, of those with any.

    Parameters
    ----------
    weights : probability of each size; the smallest is nothing
    """
    some = np.append(0.0, weights[1:])
    within = int(np.searchsorted(np.cumsum(some), SETTINGS.most_instruments * some.sum()))
    return min(within, weights.size - 1)


def changed(weights: Field) -> Field:
    """Probability of a change's size: the smaller the likelier, above the usual one.

    They fall with the root of the size, which spans several orders.
    """
    steps = np.arange(weights.size)
    above = np.where(steps > usual(weights), 2.0 ** (-steps / 2), 1e-12)
    return np.asarray(above / above.sum())


def with_sizes_up_to(most: float, weights: Field, sizes: Field) -> Field:
    """Return the probability of each size (S,) where any up to one is as likely as the usual.

    Something else passes for the component and has that size.
    """
    upto = sizes <= most
    return 0.5 * weights + 0.5 * upto / upto.sum() if upto.any() else weights
