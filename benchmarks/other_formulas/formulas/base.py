"""What a formula is: another way to make an effect of the catalogue, or one outside it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.other_formulas.shot import Shot

Apply = Callable[[Shot, float, int], Shot]
"""``apply(shot, size, seed)``: size 1 is an ordinary fault; the seed is that of the case,
`_seed` where a formula draws nothing."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Formula:
    """One formula.

    Attributes
    ----------
    name : what the formula is
    effect : the catalogue's name of its cause; empty where the catalogue has none
    apply : changes a shot
    parts : on which it shows; empty for all
    slow : whether it needs recordings of minutes
    scaled : False where its size is given instead of scaled to a signal to noise
    needs_plate : whether only a known noise level or texture shows it
    listed : effects that the sensor's file states besides
    also : other names of the catalogue that these recordings can't tell from `effect`
    """

    name: str
    effect: str
    apply: Apply
    parts: tuple[str, ...] = ()
    slow: bool = False
    scaled: bool = True
    needs_plate: bool = False
    listed: tuple[str, ...] = ()
    also: tuple[str, ...] = ()


def shared(seed: int, *more: int) -> np.random.Generator:
    """Return a generator that gives every recording of a case the same numbers."""
    return np.random.default_rng([seed, 77, *more])
