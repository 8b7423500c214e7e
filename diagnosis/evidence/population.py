"""What good instruments have of each component: learnt from a named calibration population.

`discrepancy.json` holds, for each component, the probability of each size of a grid: a lognormal
distribution over instruments, fitted to the likelihood of the sizes in each one's recordings.
`python -m benchmarks.discrepancy` makes it.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

Floats = NDArray[np.float64]
SPREADS = (0.5, 0.7, 1.0)
"""Standard deviations of the logarithm of the size among good instruments that are weighed."""


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
    """Probability of each size of a grid, from each instrument's log factors (instruments, sizes).

    Sizes are lognormal among instruments; median and spread are averaged over their posterior.
    Before any instrument a median is the less probable the larger it is, as its inverse: what no
    recording of the population could show isn't taken for usual.
    """
    log = np.stack(factors)
    steps = np.arange(log.shape[1], dtype=np.float64)
    weights, nats = [], []
    for middle in np.arange(-2.0, log.shape[1], 0.5):
        for spread in SPREADS:
            w = np.exp(-0.5 * np.square((steps - middle) * np.log(2.0) / spread))
            w = np.maximum(w / max(w.sum(), 1e-300), 1e-300)
            w /= w.sum()
            weights.append(w)
            before = -np.log(2.0) * middle
            nats.append(before + float(logsumexp(log + np.log(w), axis=1).sum()))
    posterior = np.exp(np.array(nats) - logsumexp(nats))
    return np.asarray(posterior @ np.stack(weights))
