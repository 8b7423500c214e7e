"""Explanation: causes by evidence, their laws, registration under them, unexplained components."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.claims.plate_noise import levels_of_each
from diagnosis.components.component import Component, laws_stated
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
from diagnosis.evidence.assess import Assessment, assessed_mean
from diagnosis.evidence.mean_causes import Member
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.noise_level import AGAINST_PLATES, steady_level
from diagnosis.evidence.reported_causes import Cause, Unexplained, not_yet_named, reported
from diagnosis.evidence.seen import Seen, channels_seen, seen
from diagnosis.explain_rates import explain_rates
from diagnosis.explanation import Explanation, Progress, State, Tried, completed, fitted_part
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.joint_fit import among_laws, fit_laws, refit, strongest_law
from diagnosis.physics.laws_at_edges import (
    LawAtEdges,
    factors_at_edges,
    known_laws,
    laws_at_edges,
    may_be_named,
    unusual_at_edges,
)
from diagnosis.physics.remainder import curves_of, remainder
from diagnosis.prepare import Prepared
from diagnosis.reregister.reregistration import reregistered
from diagnosis.settings import SETTINGS
from sensors.view.covariates import COVARIATES

MOVED_WITH_PLACEMENT = {c.name for c in COVARIATES.values() if c.place}
"""Covariates of effects that are fitted again where the recordings lie then."""


TRAVEL_OFF = (
    "the sensor's way is longer, shorter or in another direction than the poses say: the placement "
    "of each recording takes that up"
)


def explain(
    ready: Prepared,
    population: Population,
    *,
    withheld: frozenset[str] = frozenset(),
    notes: list[str],
    progress: Progress,
) -> Explanation:
    """Find the causes of what departs, and fit their laws.

    Parameters
    ----------
    population : what good instruments have of each component
    withheld : names of effects that must not be considered
    """
    progress("weighing causes")
    noise, baseline = ready.noise, ready.baseline
    ws = fitted_part(ready.patches, noise)
    first = seen(ws.patches, noise, Model())
    before = seen(baseline, noise, Model(), like=first) if baseline else None
    baseline_channels = channels_seen(baseline, noise, Model(), first) if baseline else {}
    departures, scales = _good(population, ready, first, before, baseline_channels)
    if ready.nominal is not None and baseline:
        changes = levels_of_each(baseline, ready.nominal)
        scales |= steady_level(changes, scales[AGAINST_PLATES])
    state = State(
        recorded=ready.recorded, patches=ready.patches, placed=ready.placed, model=Model(),
        causes=(), first=first, now=first, before=before,
    )  # fmt: skip
    good = _Good(
        noise=noise, scales=scales, baseline=Workspace.build(baseline, noise) if baseline else None
    )
    members: tuple[Member, ...] = ()
    unexplained: list[Unexplained] = []
    before_law: _BeforeLaw | None = None
    for _ in range(SETTINGS.rounds):
        found = assessed_mean(
            state.now, departures if state.before is None else scales, state.before,
            departures=departures, withheld=withheld, refuted=state.refuted,
            explained=state.explained,
        )  # fmt: skip
        if not members:
            members = found.mean
            if any(m.candidate.component.placement for m in members):
                notes.append(TRAVEL_OFF)
        if before_law is not None and before_law.still_stands_out(found):
            state, before_law = before_law.refuting(state.names[-1]), None
            continue
        named, unexplained = reported(found)
        further = _further(state, found, named, good, notes, progress)
        if further is None:
            further = _by_law_at_edges(state, found, None, good, notes, progress)
        if further is None:
            break
        before_law = _before_law(state, found, further)
        state = further
    state, of_rates = explain_rates(
        state, baseline_channels, scales, noise, withheld=withheld, notes=notes, progress=progress
    )
    return Explanation(
        model=state.model, causes=state.causes, unexplained=(*unexplained, *of_rates),
        patches=tuple(state.patches), placed=state.placed, recorded=state.recorded,
        ws=fitted_part(state.patches, noise), first=first, members=members, scales=scales,
        departures=departures,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Good:
    """What an instrument in good order has.

    Attributes
    ----------
    scales : probability of each component's sizes
    baseline : its recordings, where there are some
    """

    noise: NoiseModel
    scales: Mapping[str, Field]
    baseline: Workspace | None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _BeforeLaw:
    """How far the explanation was before a law at edges, and a member that it is to explain.

    That is another law's, or unknown physics.
    """

    state: State
    member: Member

    def still_stands_out(self, found: Assessment) -> bool:
        """Whether most of what the member gained is there beside the law."""
        name, left = self.member.candidate.name, 1.0 - SETTINGS.explained_share
        return any(
            m.candidate.name == name and m.gain > left * self.member.gain for m in found.mean
        )

    def refuting(self, name: str) -> State:
        """Return the state of before, without the law and the one that the member stands for.

        Where that is unknown physics, no law at edges explains it.
        """
        other = self.member.candidate.effect
        laws = {c.effect for c in self.state.now.components if c.relaxed.spanned}
        return replace(self.state, refuted=self.state.refuted | ({name, other} if other else laws))


def _before_law(state: State, found: Assessment, further: State) -> _BeforeLaw | None:
    """Remember what a law at edges is to explain that has another name or none; None where nothing.

    What stands for a law itself is explained as far as the law gains.
    """
    if len(further.causes) == len(state.causes) or not _is_law(further.causes[-1]):
        return None
    name = further.causes[-1].name
    state = replace(state, tried=further.tried)
    others = [
        m for m in found.mean
        if m.candidate.effect != name and not m.candidate.component.placement
        and (m.candidate.component.relaxed.spanned or not m.candidate.effect)
    ]  # fmt: skip
    return _BeforeLaw(state=state, member=others[-1]) if others else None


def _further(
    state: State,
    found: Assessment,
    named: Sequence[Cause],
    good: _Good,
    notes: list[str],
    progress: Progress,
) -> State | None:
    """Explain what stands out most: a known law's remainder, or one more cause; None if nothing.

    One law at a time: what it leaves isn't what the others would have to explain.
    """
    new = not_yet_named(named, state.names)
    if len(new) > 1:
        new = [strongest_law(new, fitted_part(state.patches, good.noise), state.model)]
    rest = remainder(found, set(state.names) - curved(state.model))
    if rest is not None and all(rest.size >= c.size for c in new):
        curve = state.model.curve.beside(curves_of(rest, state.now, good.noise.sd_mm))
        causes = tuple(_beside_curve(c, rest) for c in state.causes)
        return _seen_again(state, replace(state.model, curve=curve), causes, good.noise)
    for cause in new:
        if _is_law(cause):
            return _by_law_at_edges(state, found, cause, good, notes, progress)
        return _by_law(state, found, cause, good.noise, notes, progress)
    return None


def _by_law(
    state: State,
    found: Assessment,
    cause: Cause,
    noise: NoiseModel,
    notes: list[str],
    progress: Progress,
) -> State:
    """Fit the law of a cause that was weighed by a free curve, and look again."""
    progress(f"fitting {cause.name}")
    completing = _completed(state, cause, noise, notes)
    model, fitted = fit_laws([cause], fitted_part(completing.patches, noise), state.model)
    if state.causes:
        model, fitted = _without_remainders(state.model, model, fitted, notes)
        if not fitted:
            return replace(completing, refuted=state.refuted | {cause.name})
    return _explained_by(completing, found, model, fitted, noise)


def _by_law_at_edges(
    state: State,
    found: Assessment,
    cause: Cause | None,
    good: _Good,
    notes: list[str],
    progress: Progress,
) -> State | None:
    """Explain what stands out at edges by one law, and look again; None where nothing does.

    Of the laws that good instruments have less of, the one that explains most; of those whose size
    can't tell, it as well. What one leaves resembles the others: no second one is asked for that
    columns at points of the grids don't show.

    Parameters
    ----------
    cause : as such columns show it; None where they show none
    """
    laws = _laws_of(state, found)
    nameable = _nameable(laws, state, good)
    if cause is None and (state.gained > 0 or not nameable):
        return None
    progress("trying laws at edges")
    unusual = _unusual(nameable, laws, state, good) if nameable else []
    itself = {c.name: c.probability for c in unusual}
    usual = {law.effect for law in nameable} - itself.keys()
    everything = state.refuted | {law.effect for law in laws}
    if cause is None or cause.name in usual:
        if not unusual:  # good instruments do as much of it at edges, and of what resembles it
            return None if cause is None else replace(state, refuted=everything)
        cause = unusual[0]
    state = _completed(state, cause, good.noise, notes)
    ws = fitted_part(state.patches, good.noise)
    cause, gain, known = among_laws(
        cause, [law for law in laws if law.effect not in usual], ws, state.model,
        known=state.fitted_here(),
    )  # fmt: skip
    state = replace(state, tried=Tried(beside=state.model, patches=state.patches, laws=known))
    if state.gained > 0 and gain <= SETTINGS.doubt_of_laws * state.gained:
        # no more than what a law at edges leaves where its formula is another
        return replace(state, refuted=everything | {cause.name})
    cause = cause.at_most(itself.get(cause.name, 1.0))
    model, fitted = fit_laws([cause], ws, state.model, known=known)
    if fitted[0].doubt or cause.name not in model.names():
        # what was weighed is the law itself at points of its grid: fitted, it does next to nothing,
        # and of those beside it none does more
        refuted = (everything if gain > 0 else state.refuted) | {cause.name}
        return replace(state, refuted=refuted)
    again = _explained_by(state, found, model, fitted, good.noise)
    return replace(again, gained=state.gained + gain)


def _nameable(laws: Sequence[Component], state: State, good: _Good) -> list[Component]:
    """Pick the laws at edges whose own size could tell that they are no good instrument's."""
    listed = laws_stated(state.patches[0].view.sensor.effects)
    return [c for c in laws if may_be_named(c, good.scales, listed=listed)]


def _unusual(
    nameable: Sequence[Component], laws: Sequence[Component], state: State, good: _Good
) -> list[Cause]:
    """List the laws of which good instruments have less as causes, the least usual first.

    Where a law that good instruments have as much of explains most, it is in the model while the
    others are weighed: they resemble it.
    """
    ws, model = fitted_part(state.patches, good.noise), state.model

    def weighed(laws: Sequence[Component], model: Model) -> tuple[list[Cause], list[LawAtEdges]]:
        seen_by = laws_at_edges(laws, ws, model, good.baseline, explained=state.explained)
        may = [law for law in seen_by if law.component in nameable]
        return unusual_at_edges(may, good.scales), seen_by

    unusual, seen_by = weighed(laws, model)
    most = max(seen_by, key=lambda law: law.gain)
    names = [c.name for c in unusual]
    if not unusual or most.fitted is None or most.component.effect in names:
        return unusual
    beside = ws.levelled(model.with_effect(most.fitted.effect, most.fitted.own))
    still, _ = weighed([law for law in nameable if law.effect in names], beside)
    return still


def _completed(state: State, cause: Cause, noise: NoiseModel, notes: list[str]) -> State:
    """Complete the sensor's file where a law needs what it leaves out."""
    recorded, patches = completed(
        state.recorded, state.patches, [cause], noise, state.model, notes
    )
    return replace(state, recorded=recorded, patches=patches)


def _explained_by(
    state: State, found: Assessment, model: Model, new: Sequence[Cause], noise: NoiseModel
) -> State:
    """Take a model with new causes for true and look again."""
    explained = float(np.sqrt(state.explained**2 + sum(m.size**2 for m in found.mean)))
    again = _seen_again(state, model, (*state.causes, *new), noise)
    return replace(again, explained=explained)


def _laws_of(state: State, found: Assessment) -> list[Component]:
    """Components of laws at edges that may be named yet, by what the sensor's file states."""
    free = {*found.effects["mean"].values()} - {*state.names, *state.refuted, ""}
    known = known_laws(state.now.components, state.recorded.datasheet)
    return [c for c in known if c.effect in free]


def _seen_again(
    state: State, model: Model, causes: tuple[Cause, ...], noise: NoiseModel
) -> State:
    """Place the recordings under a model and look at them again."""
    patches, placed = reregistered(model, state.patches, state.recorded, state.placed, noise)
    ws = fitted_part(patches, noise)
    if _needs_refit(model):
        model = refit(ws.thin(SETTINGS.fitted_readings), model)
    # baselines were seen under the nominal model: beside a law they say nothing more
    return replace(
        state, patches=patches, placed=placed, model=model, causes=causes,
        now=seen(ws.patches, noise, model), before=None,
    )  # fmt: skip


def _good(
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
    kinds = kinds_of(population, factors | rates, good=True)
    departures = informed(population, kinds, factors | rates)
    among = _changes_among(ready, first, departures)
    laws = factors_at_edges(before.components, Workspace.build(ready.baseline, ready.noise))
    changes = departures | told_by_changes(population, kinds, factors | rates | laws, among)
    departures, changes = (
        alike_at_edges(one, factors, before.candidates) for one in (departures, changes)
    )
    return departures, changes


def _changes_among(
    ready: Prepared, like: Seen, departures: Mapping[str, Field]
) -> dict[str, Field]:
    """Log factors of the sizes of what later baselines have beside the first; {} of one alone."""
    earliest = min(p.recording for p in ready.baseline)
    first, later = (
        [p for p in ready.baseline if (p.recording == earliest) is is_first]
        for is_first in (True, False)
    )
    if not later:
        return {}
    noise = ready.noise
    one, other = (seen(part, noise, Model(), like=like) for part in (first, later))
    usual, channels = (channels_seen(part, noise, Model(), like) for part in (first, later))
    return change_factors(other, one, channels, usual, departures)


def _is_law(cause: Cause) -> bool:
    """Whether a cause was weighed by its law, and not by a free curve."""
    return cause.component is not None and cause.component.relaxed.spanned


def curved(model: Model) -> set[str]:
    """Return the causes beside whose laws there is a curve."""
    return {p.component.effect for p in model.curve.parts}


def _beside_curve(cause: Cause, rest: Member) -> Cause:
    """Say of a cause that its law leaves a remainder."""
    if cause.name != rest.candidate.effect:
        return cause
    return cause.doubted(
        f"Its law leaves a curve of {rest.size:.2g} of the noise (rms), which is kept beside it: "
        "the formula may be another."
    )


def _without_remainders(
    before: Model, model: Model, new: Sequence[Cause], notes: list[str]
) -> tuple[Model, list[Cause]]:
    """Drop later causes whose laws explain next to nothing: what others leave isn't their doing."""
    kept = [c for c in new if not c.doubt]
    for cause in new:
        if cause.doubt:
            notes.append(
                f"what the laws found leave goes with what {cause.name} follows, but its law "
                "explains none of it: taken for a remainder"
            )
            if cause.name not in before.names():
                model = model.without(cause.name)
    return model, kept


def _needs_refit(model: Model) -> bool:
    return any(e.covariate in MOVED_WITH_PLACEMENT for e in model.effects)
