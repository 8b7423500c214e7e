"""What the readings need beyond a model: causes with their probabilities."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.evidence.habit import Habit
from diagnosis.evidence.mean_causes import CauseSearch, Member, Scales
from diagnosis.evidence.noise_and_loss_causes import RateMember, RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.seen import Seen, worlds_of
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Assessment:
    """Causes found in each channel.

    Attributes
    ----------
    mean : members of the mean's set
    rates : members of the other channels
    effects : by channel, the effect of each candidate ("" of unknown ones)
    usual : what good instruments have as well
    """

    mean: tuple[Member, ...]
    rates: tuple[RateMember, ...]
    effects: Mapping[str, Mapping[str, str]]
    usual: tuple[Habit, ...] = ()


def assessed_mean(
    found: Seen,
    scales: Mapping[str, Floats],
    baseline: Seen | None = None,
    *,
    departures: Mapping[str, Floats] | None = None,
    withheld: frozenset[str] = frozenset(),
    refuted: Collection[str] = (),
    explained: float = 0.0,
) -> Assessment:
    """Weigh the causes of what the mean departs by.

    Parameters
    ----------
    scales : probabilities of each component's size in this instrument when it is good; of each
        change beside baselines
    baseline : recordings of the same instrument when it was good
    departures : probabilities of what baselines and recordings share; `scales` where left out
    withheld : effects that must not be named: what follows their covariates has no name then
    refuted : effects whose laws were fitted and do nothing here: no candidates any more
    explained : whitened rms of what the model explains already
    """
    search = _search(found, scales, baseline, departures, withheld, refuted, explained)
    effects = {c.name: "" if c.effect in withheld else c.effect for c in found.candidates}
    members, usual = search.search()
    return Assessment(
        mean=tuple(members), rates=(), effects={"mean": effects}, usual=tuple(usual)
    )


def weighed_again(
    members: Sequence[Member],
    found: Seen,
    scales: Mapping[str, Floats],
    baseline: Seen | None = None,
    *,
    departures: Mapping[str, Floats] | None = None,
    withheld: frozenset[str] = frozenset(),
    refuted: Collection[str] = (),
) -> list[Member]:
    """Weigh a set of causes in the equations of other recordings; see `assessed_mean`."""
    search = _search(found, scales, baseline, departures, withheld, refuted)
    candidates = {c.name: c for c in search.candidates}
    known = [
        (candidates[m.candidate.name], m.variant, m.size)
        for m in members
        if m.candidate.name in candidates
        and m.variant < len(candidates[m.candidate.name].shapes)
    ]
    return search.weighed(known, search.usual_beside(known))


def _search(
    found: Seen,
    scales: Mapping[str, Floats],
    baseline: Seen | None,
    departures: Mapping[str, Floats] | None,
    withheld: frozenset[str],
    refuted: Collection[str] = (),
    explained: float = 0.0,
) -> CauseSearch:
    """Set up the search over causes in the equations of recordings and of their baselines."""
    return CauseSearch(
        worlds_of(found, baseline),
        [
            c.unclaimed() if c.effect in withheld else c
            for c in found.candidates
            if c.effect not in refuted
        ],
        Scales(sizes=SETTINGS.mean_sizes(), weights=scales),
        Scales(sizes=SETTINGS.mean_sizes(), weights=scales if departures is None else departures),
        explained=explained,
    )  # fmt: skip


def assessed_rates(
    channels: Sequence[Channel],
    scales: Mapping[str, Floats],
    *,
    withheld: frozenset[str] = frozenset(),
) -> Assessment:
    """Weigh the causes of what the scale, the losses and the outliers depart by."""
    rates: list[RateMember] = []
    usual: list[Habit] = []
    effects: dict[str, dict[str, str]] = {}
    for channel in channels:
        scales_of = Scales(sizes=SETTINGS.rate_sizes(), weights=scales)
        found, habits = RateSearch(channel, scales_of, withheld).search()
        rates += found
        usual += habits
        known = {c.name: c.component.effect for c in channel.candidates}
        effects[channel.name] = {n: "" if e in withheld else e for n, e in known.items()}
    return Assessment(
        mean=(), rates=tuple(rates), effects=effects, usual=tuple(usual)
    )
