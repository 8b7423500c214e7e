"""Recordings and baselines under the nominal model: where every explanation begins."""

from collections.abc import Mapping
from dataclasses import dataclass

from diagnosis.discrepancy.population import Population
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.seen import Seen, channels_seen, seen
from diagnosis.explanation import fitted_part
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.prepare import Prepared
from diagnosis.usual_sizes import usual_sizes


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FirstLook:
    """What is seen before any cause is known, and what a good instrument has.

    Attributes
    ----------
    now, before : the mean of the recordings, and of baselines, where there are some
    baseline_channels : noise, losses and outliers of the baselines, by name
    departures : probability of the sizes of what the instrument departs from the nominal model by
    scales : of what is weighed, changes beside baselines
    """

    now: Seen
    before: Seen | None
    baseline_channels: Mapping[str, Channel]
    departures: Mapping[str, Field]
    scales: Mapping[str, Field]


def first_look(ready: Prepared, population: Population) -> FirstLook:
    """Look at recordings and baselines, and tell what the instrument has when it is good.

    Parameters
    ----------
    population : what good instruments have of each component
    """
    noise, baseline = ready.noise, ready.baseline
    now = seen(fitted_part(ready.patches, noise).patches, noise, Model())
    before = seen(baseline, noise, Model(), like=now) if baseline else None
    channels = channels_seen(baseline, noise, Model(), now) if baseline else {}
    departures, scales = usual_sizes(population, ready, now, before, channels)
    return FirstLook(
        now=now, before=before, baseline_channels=channels, departures=departures, scales=scales
    )
