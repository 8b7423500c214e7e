"""Which passes to take: greedy set cover, and the trade of length against coverage."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from pipeline.passes.straight_passes import Pass, Samples, candidates
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Plan:
    """Passes in the order taken, and after each of them what has been seen.

    Attributes
    ----------
    passes : tuple of Pass
    coverage : (p,)
        Share of the surface seen by the first passes.
    length_mm : (p,)
        Length of the first passes.
    incidence_deg : (p,)
        Mean incidence over what they see, each point from its best pass.
    reachable : float
        Share of the surface that any candidate sees.
    seen : (k,) bool
        Samples that the plan sees.
    """

    passes: tuple[Pass, ...]
    coverage: Floats
    length_mm: Floats
    incidence_deg: Floats
    reachable: float
    seen: NDArray[np.bool_]


SAMPLES: Final = 2000
"""Points at which a recipe's cover is planned: a share of 0.98 is known to 0.3 %, one deviation."""


def planned_passes(
    part: Part, scene: Scene, datasheet: Datasheet, cover: float
) -> tuple[Pass, ...]:
    """Return the passes of a recipe's `motion.cover`: the same for the same part and sensor.

    Raises
    ------
    PartError
        Where no pass sees the part.
    """
    samples = Samples.of(part, scene, SAMPLES, np.random.default_rng(0))
    tried = list(candidates(samples, scene, datasheet))
    if not any(one.seen.any() for one in tried):
        raise PartError(part.name, "no pass sees anything of it", "a sensor with another range")
    return plan_cover(tried, cover).passes


def plan_cover(candidates: Sequence[Pass], cover: float, *, per_mm: bool = True) -> Plan:
    """Take the pass that sees most per mm of what is not yet seen, until `cover` is reached.

    Greedy cover needs at most 1 + ln k times the least length (Chvátal, Math. Oper. Res. 4 (1979)
    233). A pass that the later ones make needless is dropped.

    Parameters
    ----------
    candidates
        Passes over one set of samples.
    cover
        Share of the surface that is wanted; what no candidate sees can't be had.
    per_mm
        False: the pass that sees most, whatever its length.
    """
    every = np.stack([one.seen for one in candidates])
    reachable = every.any(axis=0)
    wanted = min(cover, float(reachable.mean()))
    lengths = np.array([one.length_mm if per_mm else 1.0 for one in candidates])
    seen = np.zeros(every.shape[1], dtype=np.bool_)
    taken: list[int] = []
    while seen.mean() < wanted:
        gain = (every & ~seen).sum(axis=1) / lengths
        best = int(np.argmax(gain))
        taken.append(best)
        seen |= every[best]
    for index in list(taken):
        rest = [other for other in taken if other != index]
        if rest and every[rest].any(axis=0).mean() >= wanted:
            taken = rest
    chosen = [candidates[index] for index in taken]
    best_cosine = np.maximum.accumulate(np.stack([one.cosine for one in chosen]), axis=0)
    hit = best_cosine > 0
    angle = np.degrees(np.arccos(np.clip(best_cosine, 0, 1)))
    return Plan(
        passes=tuple(chosen),
        coverage=hit.mean(axis=1),
        length_mm=np.cumsum([one.length_mm for one in chosen]),
        incidence_deg=(angle * hit).sum(axis=1) / hit.sum(axis=1),
        reachable=float(reachable.mean()),
        seen=hit[-1],
    )
