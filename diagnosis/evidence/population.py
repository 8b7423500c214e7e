"""What good instruments have of each component: learnt from a named calibration population.

`discrepancy.json` holds, for each component, the probability of each size of a grid: the mixing
distribution that makes the recordings of the population most probable (Laird, J. Am. Stat. Assoc.
73 (1978) 805), found by EM from a flat start. `python -m benchmarks.discrepancy` makes it.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
ROUNDS = 30
"""EM steps: the mixture is kept smooth by stopping early."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Population:
    """A named population and what it says.

    Attributes
    ----------
    weights : for each component's name, probability of each size
    """

    name: str
    weights: Mapping[str, Floats]


@cache
def population() -> Population:
    """Read the population that the project was calibrated on."""
    text = (files("diagnosis") / "discrepancy.json").read_text(encoding="utf-8")
    found = json.loads(text)
    return Population(
        name=found["population"],
        weights={n: np.array(w) for n, w in found["components"].items()},
    )


def mixed(factors: Sequence[Floats]) -> Floats:
    """Mixing distribution over sizes from each instrument's log factors (instruments, sizes)."""
    log = np.stack(factors)
    weights = np.full(log.shape[1], 1.0 / log.shape[1])
    for _ in range(ROUNDS):
        with np.errstate(divide="ignore"):
            joint = log + np.log(weights)
        each = np.exp(joint - logsumexp(joint, axis=1, keepdims=True))
        # one instrument more, of no preference
        weights = (each.sum(axis=0) + SETTINGS.unseen / log.shape[1]) / (len(log) + SETTINGS.unseen)
    return weights
