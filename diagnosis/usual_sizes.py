"""What this instrument usually has of each component, and usually changes by."""

from collections.abc import Mapping, Sequence

from diagnosis.claims.plate_noise import levels_of_each
from diagnosis.data.patch import Patch
from diagnosis.discrepancy.good_instrument import (
    alike_at_edges,
    change_factors,
    informed,
    kinds_of,
    mean_factors,
    told_by_changes,
)
from diagnosis.discrepancy.population import Population
from diagnosis.evidence.long_waves import long_wave_factors
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
    good: Sequence[Seen],
    rates: Mapping[str, Field],
) -> tuple[dict[str, Field], dict[str, Field]]:
    """Probability of each component's sizes in this instrument when it is good.

    Parameters
    ----------
    before, good : baselines, where there are some; their parts, see `good_seen`
    rates : log factors of sizes of noise, losses and outliers in baselines; without any in the
        recordings

    Returns
    -------
    of what it departs from the nominal model by; of what is weighed, changes beside baselines
    """
    if before is None:
        kinds = kinds_of(population, {**mean_factors(first), **rates}, good=False)
        departures = population.of_kinds(kinds)
        return departures, departures
    mean = mean_factors(before)
    factors = {
        **mean, **rates, **long_wave_factors(Workspace.build(ready.baseline, ready.noise)),
    }  # fmt: skip
    kinds = kinds_of(population, factors, good=True)
    departures = informed(population, kinds, factors)
    among, laws = changes_among(ready, good, departures)
    changes = departures | told_by_changes(population, kinds, factors | laws, among)
    departures, changes = (
        alike_at_edges(one, mean, before.candidates) for one in (departures, changes)
    )
    if ready.nominal is not None:
        levels = levels_of_each(ready.baseline, ready.nominal)
        changes |= steady_level(levels, changes[AGAINST_PLATES])
    return departures, changes


def good_seen(ready: Prepared, like: Seen) -> tuple[Seen, ...]:
    """Look at the first baseline, and at the later ones where there are some; () of none."""
    return tuple(
        seen(part, ready.noise, Model(), like=like) for part in _in_order(ready.baseline) if part
    )


def _in_order(baseline: Sequence[Patch]) -> tuple[list[Patch], list[Patch]]:
    """Part baselines into the first one and later ones."""
    earliest = min((p.recording for p in baseline), default=0)
    first, later = (
        [p for p in baseline if (p.recording == earliest) is is_first]
        for is_first in (True, False)
    )
    return first, later


def changes_among(
    ready: Prepared, good: Sequence[Seen], departures: Mapping[str, Field]
) -> tuple[dict[str, Field], dict[str, Field]]:
    """Log factors of sizes in later baselines, of what they have beside the first; {} of one alone.

    Parameters
    ----------
    good : baselines, see `good_seen`

    Returns
    -------
    of what they change by; of all that laws at edges do in them
    """
    if len(good) < 2:
        return {}, {}
    noise, parts = ready.noise, _in_order(ready.baseline)
    one, other = good
    usual, channels = (channels_seen(part, noise, Model(), one) for part in parts)
    before, after = (Workspace.build(part, noise) for part in parts)
    laws = shown_at_edges(one.components, after, before)
    among = change_factors(other, one, channels, usual, departures) | factors_at_edges(laws)
    return among, {law.key: law.all_factors for law in laws}
