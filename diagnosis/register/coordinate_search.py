"""Search of a minimum along one number after the other, where the cost has steps."""

from collections.abc import Callable, Sequence

import numpy as np

from diagnosis.fields import Field


def step_by_step(
    cost: Callable[[Field], float], count: int, reaches: Sequence[float]
) -> tuple[Field, float]:
    """Search (count,) numbers from zero on, one at a time, with shorter and shorter steps.

    Returns
    -------
    the best, and by how much it costs less
    """
    best = np.zeros(count)
    before = least = cost(best)
    for reach in reaches:
        for k in range(count):
            from_here = least
            for sign in (-1.0, 1.0):
                if least < from_here:
                    break  # the way back is known
                for _ in range(4):
                    trial = best.copy()
                    trial[k] += sign * reach
                    value = cost(trial)
                    if value >= least - 1e-9:
                        break
                    best, least = trial, value
    return best, before - least
