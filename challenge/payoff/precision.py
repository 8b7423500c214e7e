"""Average precision of points and of flaws, and the share of a gap that is closed.

Scores are sorted into bins first, for each recording and each group of flaws apart, so that any
resampling of the recordings only adds histograms.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter

from challenge.payoff.flaws import KINDS, SIZES

Floats = NDArray[np.float64]

GROUPS = tuple((kind, size) for kind in KINDS for size in SIZES)
BINS = 2000
_NEAR = 4  # points: a hit this far from a flaw's mask still means it, and peaks this near are one


@dataclass(frozen=True, kw_only=True, slots=True)
class Tally:
    """Histograms of the scores of one test recording under one model.

    Attributes
    ----------
    hits : (groups, BINS)
        Points, or flaws, of each group, by score.
    false : (BINS,)
        Points of no flaw, or alarms that meet none.
    missed : (groups,)
        Flaws that no alarm meets; 0 for points.
    """

    hits: Floats
    false: Floats
    missed: Floats


def average_precision(hits: Floats, false: Floats, missed: Floats | float = 0.0) -> Floats:
    """Mean precision over recall, from histograms with the lowest score first.

    What shares a bin is a tie: the precision after all of it counts. Area under the steps, without
    interpolation.

    Parameters
    ----------
    hits : (..., b)
    false : (..., b)
    missed : (...)
        Positives without any score.

    Returns
    -------
    (...) : NaN where there is no positive.
    """
    right = np.cumsum(hits[..., ::-1], -1)
    wrong = np.cumsum(false[..., ::-1], -1)
    precision = right / np.maximum(right + wrong, 1e-12)
    total = right[..., -1] + missed
    area = (hits[..., ::-1] * precision).sum(-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(total > 0, area / total, np.nan))


def _bin(scores: NDArray[np.floating]) -> NDArray[np.int64]:
    """Bin of a score of 0 to 1, even in its logit between 0.0001 and 0.9999."""
    p = np.clip(np.asarray(scores, np.float64), 1e-4, 1 - 1e-4)
    wide = np.log(p / (1 - p)) / np.log(1e4 - 1)
    return np.asarray(np.clip((wide + 1) / 2 * BINS, 0, BINS - 1), np.int64)


def tally_points(
    score: NDArray[np.floating], instance: NDArray[np.int16], flaws: tuple[tuple[str, str], ...]
) -> Tally:
    """Count points by score; those labelled -1 count neither way."""
    bins = _bin(score)
    hits = np.zeros((len(GROUPS), BINS))
    for k, flaw in enumerate(flaws):
        hits[GROUPS.index(flaw)] += np.bincount(bins[instance == k + 1], minlength=BINS)
    false = np.bincount(bins[instance == 0], minlength=BINS).astype(np.float64)
    return Tally(hits=hits, false=false, missed=np.zeros(len(GROUPS)))


def tally_flaws(
    score: NDArray[np.floating], instance: NDArray[np.int16], flaws: tuple[tuple[str, str], ...]
) -> Tally:
    """Count flaws by the score of the highest alarm on them, and alarms on none.

    An alarm is a local maximum of the scores' mean over a point's neighbours.
    """
    calm = gaussian_filter(np.asarray(score, np.float64), 0.7, truncate=2)
    size = 2 * _NEAR + 1
    peak = (calm == maximum_filter(calm, size)) & (calm > 2e-4)
    # labels widen by the tolerance; a gap between two flaws is wider than that twice
    meant = maximum_filter(np.maximum(instance, 0), 2 * (_NEAR // 2) + 1)
    hits, missed = np.zeros((len(GROUPS), BINS)), np.zeros(len(GROUPS))
    rows, columns = np.nonzero(peak)
    bins, meets = _bin(calm[rows, columns]), meant[rows, columns]
    for k, flaw in enumerate(flaws):
        if not (instance == k + 1).any():
            continue
        found = bins[meets == k + 1]
        if found.size:
            hits[GROUPS.index(flaw), found.max()] += 1
        else:
            missed[GROUPS.index(flaw)] += 1
    alone = (meets == 0) & (instance[rows, columns] == 0)
    false = np.bincount(bins[alone], minlength=BINS).astype(np.float64)
    return Tally(hits=hits, false=false, missed=missed)


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """A figure with its 95 % interval."""

    value: float
    low: float
    high: float


def estimate(value: float, draws: Floats) -> Estimate:
    """Percentile interval of bootstrap draws."""
    good = draws[np.isfinite(draws)]
    low, high = np.percentile(good, [2.5, 97.5]) if good.size else (np.nan, np.nan)
    return Estimate(value=float(value), low=float(low), high=float(high))


def share_closed(plain: Floats, diagnosed: Floats, upper: Floats) -> Floats:
    """Share of the gap between plain and upper bound that the diagnosed simulation closes."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((diagnosed - plain) / (upper - plain))
