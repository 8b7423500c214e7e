"""Plans of many lengths over one part, and those that no other beats in length and coverage."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.passes.set_cover import Plan, plan_cover
from pipeline.passes.straight_passes import Pass

SHARES: Final = tuple(k / 10 for k in range(1, 10))
"""Coverages, beside the one wanted, that plans are made for."""


def trade(candidates: Sequence[Pass], cover: float) -> tuple[Plan, ...]:
    """Return plans to choose from: each pass alone, and greedy covers of less than is wanted.

    The plan of `cover` itself comes first. Greedy covers go by coverage for each mm, and by
    coverage alone.
    """
    shares = [share for share in SHARES if share < cover]
    plans = [plan_cover(candidates, cover), plan_cover(candidates, cover, per_mm=False)]
    for share in shares:
        plans += [plan_cover(candidates, share, per_mm=per_mm) for per_mm in (True, False)]
    plans += [plan_cover([one], 1.0) for one in candidates if one.seen.any()]
    return tuple(plans)


def front(plans: Sequence[Plan]) -> NDArray[np.bool_]:
    """Return which plans are Pareto optimal: no other is as short and sees as much.

    Of plans that are equal in both the first counts.
    """
    length = np.array([plan.length_mm[-1] for plan in plans])
    coverage = np.array([plan.coverage[-1] for plan in plans])
    order = np.lexsort((np.arange(len(plans)), -coverage, length))
    best = np.concatenate([[-np.inf], np.maximum.accumulate(coverage[order])[:-1]])
    optimal = np.zeros(len(plans), dtype=np.bool_)
    optimal[order] = coverage[order] > best
    return optimal
