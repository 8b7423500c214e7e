"""Whether what an answer calls probable is so: reliability, calibration error, log score."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.judging.score import SWITCHES

BINS = 10
_LEAST = 1e-3  # a probability of 0 or 1 that is wrong costs as much as this one


def stated(case: Mapping[str, Any]) -> list[tuple[float, bool]]:
    """Probability of each name that an answer gives, and whether the name is right.

    Parameters
    ----------
    case : a judged case, with its ``secret`` and the answer's ``effects``
    """
    right = {n for switch in case["secret"]["switches"] for n in SWITCHES[switch].accept}
    entries = [x for e in case["effects"] for x in (e, *e.get("alternatives", []))]
    return [
        (float(x["probability"]), str(x["name"]) in right)
        for x in entries
        if "probability" in x and x["name"] != "empirical"
    ]


def stated_strange(case: Mapping[str, Any]) -> list[tuple[float, bool]]:
    """Probability that no name of the catalogue is right, where an answer gives one.

    Only cases that hide something: in a null there is nothing to name.
    """
    given = case.get("none_of_these")
    if given is None or case["secret"]["kind"] == "null":
        return []
    return [(float(given), case["secret"]["kind"] == "unknown")]


def reliability(pairs: Iterable[tuple[float, bool]]) -> list[tuple[float, float, int]]:
    """Mean probability, share right and count, by tenths of the probability."""
    given = list(pairs)
    if not given:
        return []
    p = np.array([a for a, _ in given])
    hit = np.array([float(b) for _, b in given])
    which = _tenths(p)
    return [
        (float(p[which == b].mean()), float(hit[which == b].mean()), int((which == b).sum()))
        for b in range(BINS)
        if (which == b).any()
    ]


def _tenths(p: NDArray[np.float64]) -> NDArray[np.int64]:
    """Tenth in which each probability lies."""
    return np.minimum((p * BINS).astype(np.int64), BINS - 1)


def calibration_error(curve: Iterable[tuple[float, float, int]]) -> float:
    """Return the expected calibration error (Naeini et al., AAAI 2015), NaN without names."""
    rows = list(curve)
    total = sum(n for _, _, n in rows)
    return sum(n * abs(p - share) for p, share, n in rows) / total if total else float("nan")


def error_by_chance(pairs: Iterable[tuple[float, bool]]) -> float:
    """Return the calibration error expected of as many names whose probabilities are true.

    In each tenth the number of right names is Poisson-binomial; few names depart by chance.
    """
    given = np.array([p for p, _ in pairs])
    which = _tenths(given)
    apart = 0.0
    for p in (given[which == b] for b in range(BINS)):
        chances = np.ones(1)
        for one in p:
            chances = np.convolve(chances, [1.0 - one, one])
        apart += float(chances @ np.abs(np.arange(chances.size) - p.sum()))
    return apart / given.size if given.size else float("nan")


def log_score(pairs: Iterable[tuple[float, bool]]) -> float:
    """Mean negative log probability of what was so, nats a name; NaN without names."""
    given = [(_bounded(p), hit) for p, hit in pairs]
    if not given:
        return float("nan")
    return float(-np.mean([np.log(p if hit else 1 - p) for p, hit in given]))


def score_by_chance(pairs: Iterable[tuple[float, bool]]) -> float:
    """Return the log score expected where the probabilities are true: their mean entropy."""
    given = [_bounded(p) for p, _ in pairs]
    if not given:
        return float("nan")
    return float(-np.mean([p * np.log(p) + (1 - p) * np.log(1 - p) for p in given]))


def _bounded(p: float) -> float:
    """Keep a probability from 0 and 1."""
    return min(max(p, _LEAST), 1 - _LEAST)
