"""What this instrument usually has of each component, and usually changes by."""

from collections.abc import Mapping

from diagnosis.claims.plate_noise import levels_of_each
from diagnosis.discrepancy.good_instrument import (
    alike_at_edges,
    change_factors,
    informed,
    kinds_of,
    mean_factors,
    rate_factors,
    told_by_changes,
)
from diagnosis.discrepancy.population import Population
from diagnosis.evidence.long_waves import long_wave_factors
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.noise_level import AGAINST_PLATES, steady_level
from diagnosis.evidence.seen import Seen, channels_seen, seen
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.laws_at_edges import factors_at_edges, shown_at_edges
from diagnosis.prepare import Prepared


def usual_sizes(
    population: Population,
    ready: Prepared,
    first: Seen,
    before: Seen | None,
    baseline_channels: Mapping[str, Channel],
) -> tuple[dict[str, Field], dict[str, Field]]:
    """Probability of each component's sizes in this instrument when it is good.

    Parameters
    ----------
    before, baseline_channels : the mean and the channels of baselines, where there are some

    Returns
    -------
    of what it departs from the nominal model by; of what is weighed, changes beside baselines
    """
    if before is None:
        patches = [p for p in ready.patches if p.fit.any()]
        rates = rate_factors(channels_seen(patches, ready.noise, Model(), first).values())
        kinds = kinds_of(population, mean_factors(first) | rates, good=False)
        departures = population.of_kinds(kinds)
        return departures, departures
    factors = mean_factors(before)
    rates = rate_factors(baseline_channels.values())
    rates |= long_wave_factors(Workspace.build(ready.baseline, ready.noise))
    kinds = kinds_of(population, factors | rates, good=True)
    departures = informed(population, kinds, factors | rates)
    among, laws = changes_among(ready, first, departures)
    changes = departures | told_by_changes(population, kinds, factors | rates | laws, among)
    departures, changes = (
        alike_at_edges(one, factors, before.candidates) for one in (departures, changes)
    )
    if ready.nominal is not None:
        levels = levels_of_each(ready.baseline, ready.nominal)
        changes |= steady_level(levels, changes[AGAINST_PLATES])
    return departures, changes


def changes_among(
    ready: Prepared, like: Seen, departures: Mapping[str, Field]
) -> tuple[dict[str, Field], dict[str, Field]]:
    """Log factors of sizes in later baselines, of what they have beside the first; {} of one alone.

    Returns
    -------
    of what they change by; of all that laws at edges do in them
    """
    earliest = min(p.recording for p in ready.baseline)
    first, later = (
        [p for p in ready.baseline if (p.recording == earliest) is is_first]
        for is_first in (True, False)
    )
    if not later:
        return {}, {}
    noise = ready.noise
    one, other = (seen(part, noise, Model(), like=like) for part in (first, later))
    usual, channels = (channels_seen(part, noise, Model(), like) for part in (first, later))
    before, after = (Workspace.build(part, noise) for part in (first, later))
    laws = shown_at_edges(one.components, after, before)
    among = change_factors(other, one, channels, usual, departures) | factors_at_edges(laws)
    return among, {law.key: law.all_factors for law in laws}
