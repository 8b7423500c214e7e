"""Recordings and baselines under the nominal model: where every explanation begins."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from diagnosis.discrepancy.good_instrument import rate_factors
from diagnosis.discrepancy.population import Population
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.seen import Seen, channels_seen, seen, together
from diagnosis.explanation import fitted_part
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.prepare import Prepared
from diagnosis.usual_sizes import good_seen, usual_sizes


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FirstLook:
    """What is seen before any cause is known, and what a good instrument has.

    Attributes
    ----------
    now, before : the mean of the recordings, and of baselines, where there are some
    baseline_channels : noise, losses and outliers of the baselines, by name
    departures : probability of the sizes of what the instrument departs from the nominal model by
    scales : of what is weighed, changes beside baselines
    good : the mean of the first baseline, and of later ones
    rates : log factors of sizes of noise, losses and outliers, in baselines where there are some
    """

    now: Seen
    before: Seen | None
    baseline_channels: Mapping[str, Channel]
    departures: Mapping[str, Field]
    scales: Mapping[str, Field]
    good: tuple[Seen, ...]
    rates: Mapping[str, Field]


def first_look(ready: Prepared, population: Population) -> FirstLook:
    """Look at recordings and baselines, and tell what the instrument has when it is good.

    Parameters
    ----------
    population : what good instruments have of each component
    """
    noise, fitted = ready.noise, fitted_part(ready.patches, ready.noise).patches
    now = seen(fitted, noise, Model())
    channels = channels_seen(ready.baseline or fitted, noise, Model(), now)
    return _look(
        ready, population, now, good_seen(ready, now), channels if ready.baseline else {},
        rate_factors(channels.values()),
    )  # fmt: skip


def louder_look(
    look: FirstLook, ready: Prepared, population: Population, power: float
) -> FirstLook:
    """Look again where the noise has so much more power for a mismatch of the mean.

    Parameters
    ----------
    ready : with that noise
    """
    return _look(
        ready, population, look.now.louder(power), tuple(g.louder(power) for g in look.good),
        look.baseline_channels, look.rates,
    )  # fmt: skip


def _look(
    ready: Prepared, population: Population, now: Seen, good: Sequence[Seen],
    channels: Mapping[str, Channel], rates: Mapping[str, Field],
) -> FirstLook:  # fmt: skip
    before = together(good, ready.baseline) if good else None
    departures, scales = usual_sizes(population, ready, now, before, good, rates)
    return FirstLook(
        now=now, before=before, good=tuple(good), baseline_channels=channels, rates=rates,
        departures=departures, scales=scales,
    )  # fmt: skip
