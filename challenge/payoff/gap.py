"""How much of the gap is closed: averages, and a bootstrap over recordings and training seeds."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.cases.seeds import child
from challenge.payoff.precision import (
    GROUPS,
    Estimate,
    average_precision,
    estimate,
    share_closed,
)

Floats = NDArray[np.float64]

TRAINED_ON = ("plain", "noise", "diagnosed", "both", "instrument")
KINDS = ("boosted", "convolutional")
"""Segmenters."""
AIMED = "both"
"""The set whose share of the gap the aim is for."""
DRAWS = 400


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """Average precision in one world, or averaged over several.

    Attributes
    ----------
    groups : (sets, seeds, groups)
        Of every kind and size; NaN where the test holds none. One seed where worlds are averaged.
    drawn : (draws, sets, groups)
        The same under resampling, seeds averaged.
    """

    groups: Floats
    drawn: Floats

    def mean(self) -> list[Estimate]:
        """Mean over kinds and sizes for each set of training data."""
        values, draws = _over(self.groups.mean(1)), _over(self.drawn)
        return [estimate(values[k], draws[:, k]) for k in range(values.size)]

    def gap(self, group: int | None = None) -> Estimate:
        """Instrument less plain, for one group or their mean."""
        value, draws = self._pick(group)
        return estimate(value[-1] - value[0], draws[:, -1] - draws[:, 0])

    def closed(self, name: str = AIMED, group: int | None = None) -> Estimate | None:
        """Share of the gap that a set closes; None where the gap may be chance."""
        gap = self.gap(group)
        if not gap.low > 0:
            return None
        value, draws = self._pick(group)
        three = [TRAINED_ON.index(each) for each in ("plain", name, "instrument")]
        return estimate(
            float(share_closed(*value[three])), share_closed(*draws[:, three].T)
        )

    def _pick(self, group: int | None) -> tuple[Floats, Floats]:
        values, draws = self.groups.mean(1), self.drawn
        if group is None:
            return _over(values), _over(draws)
        return values[:, group], draws[..., group]


def _over(groups: Floats) -> Floats:
    """Mean over kinds and sizes, those without flaws left out."""
    some = np.isfinite(groups)
    total = np.where(some, groups, 0.0).sum(-1)
    return np.asarray(total / np.maximum(some.sum(-1), 1), np.float64)


def counted(file: Path, kind: str, what: str) -> dict[str, NDArray[np.int32]]:
    """Read a world's histograms: ``hits`` (sets, seeds, recordings, groups, bins) and so on."""
    with np.load(file) as kept:
        seeds = sum(key.startswith(f"{kind}/{what}/plain/") for key in kept) // 3
        return {
            field: np.stack(
                [
                    np.stack(
                        [kept[f"{kind}/{what}/{name}/{turn}/{field}"] for turn in range(seeds)]
                    )
                    for name in TRAINED_ON
                ]
            )
            for field in ("hits", "false", "missed")
        }


def outcome(tallies: dict[str, Any], seed: int, *, draws: int = DRAWS) -> Outcome:
    """Score one world; the sets share every resampled recording and seed."""
    # recordings first: a resampling is a product of its weights with histograms
    first = {
        field: np.ascontiguousarray(np.moveaxis(tallies[field], 2, 0), np.float64)
        for field in ("hits", "false", "missed")
    }
    recordings, _, seeds = first["hits"].shape[:3]

    def precision(weight: Floats) -> Floats:
        # recordings add up before anything is divided
        hits, false, missed = (
            (weight @ first[field].reshape(recordings, -1)).reshape(first[field].shape[1:])
            for field in ("hits", "false", "missed")
        )
        return average_precision(hits, false[:, :, None], missed)

    rng = child(seed, "bootstrap")
    drawn = np.empty((draws, len(TRAINED_ON), len(GROUPS)))
    for k in range(draws):
        weight = np.bincount(rng.integers(recordings, size=recordings), minlength=recordings)
        turns = rng.integers(seeds, size=seeds)
        drawn[k] = precision(weight.astype(np.float64))[:, turns].mean(1)
    return Outcome(groups=precision(np.ones(recordings)), drawn=drawn)


def pooled(outcomes: list[Outcome]) -> Outcome:
    """Average several worlds; each is resampled for itself."""
    def average(arrays: list[Floats]) -> Floats:
        stack = np.stack(arrays)
        some = np.isfinite(stack)
        count = some.sum(0)
        total = np.where(some, stack, 0.0).sum(0)
        return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))

    return Outcome(
        groups=average([o.groups.mean(1, keepdims=True) for o in outcomes]),
        drawn=average([o.drawn for o in outcomes]),
    )
