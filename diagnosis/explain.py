"""Explanation: causes by evidence, their laws, registration under them, unexplained components."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from diagnosis.evidence.assess import Assessment, assessed_mean
from diagnosis.evidence.mean_causes import Member
from diagnosis.evidence.reported_causes import (
    Cause,
    Unexplained,
    not_yet_named,
    reported,
    usual_components,
)
from diagnosis.explain_laws import (
    Good,
    by_law,
    by_law_at_edges,
    is_law,
    seen_again,
    weighed_at_edges,
)
from diagnosis.explain_rates import explain_rates
from diagnosis.explanation import Explanation, Progress, State, fitted_part
from diagnosis.first_look import FirstLook
from diagnosis.model.model import Model
from diagnosis.physics.joint_fit import strongest_law
from diagnosis.physics.remainder import curves_of, remainder
from diagnosis.prepare import Prepared
from diagnosis.settings import SETTINGS

TRAVEL_OFF = (
    "the sensor's way is longer, shorter or in another direction than the poses say: the placement "
    "of each recording takes that up"
)


def explain(
    ready: Prepared,
    look: FirstLook,
    *,
    withheld: frozenset[str] = frozenset(),
    refuted: frozenset[str] = frozenset(),
    notes: list[str],
    progress: Progress,
) -> Explanation:
    """Find the causes of what departs, and fit their laws.

    Parameters
    ----------
    withheld : names of effects that must not be considered
    refuted : names of effects that readings were found to speak against
    """
    progress("weighing causes")
    noise, scales, departures = ready.noise, look.scales, look.departures
    state = State(
        recorded=ready.recorded, patches=ready.patches, placed=ready.placed, model=Model(),
        causes=(), first=look.now, now=look.now, before=look.before, refuted=refuted,
        filtered=ready.filtered is not None,
    )  # fmt: skip
    good = Good(noise=noise, scales=scales, departures=departures, baseline=ready.baseline)
    members: tuple[Member, ...] = ()
    unexplained: list[Unexplained] = []
    usual: list[Unexplained] = []
    usual_laws: Sequence[Unexplained] = ()
    before_law: _BeforeLaw | None = None
    by_itself = refuted
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
        usual = usual_components(found)
        further = _further(state, found, named, good, notes, progress)
        if further is None and state.gained <= 0:
            at_edges = weighed_at_edges(state, found, good, progress)
            usual_laws = at_edges.habits
            if at_edges.unusual:
                further = by_law_at_edges(state, found, at_edges, None, good, notes)
        if further is None:
            break
        before_law = _before_law(state, found, further)
        members += _of_new(found, further.names, members)
        state = further
        if not state.causes:
            by_itself = state.refuted
    state, of_rates, usual_rates = explain_rates(
        state, look.baseline_channels, scales, noise, withheld=withheld, notes=notes,
        progress=progress,
    )  # fmt: skip
    return Explanation(
        model=state.model, causes=state.causes, unexplained=(*unexplained, *of_rates),
        patches=tuple(state.patches), placed=state.placed, recorded=state.recorded,
        ws=fitted_part(state.patches, noise), first=look.now, before=look.before,
        members=tuple(m for m in members if m.candidate.effect not in state.refuted),
        scales=scales, departures=departures, refuted=by_itself,
        usual=(*usual, *(u for u in usual_laws if u.component not in state.names), *usual_rates),
    )  # fmt: skip


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


def _of_new(
    found: Assessment, names: Sequence[str], known: Sequence[Member]
) -> tuple[Member, ...]:
    """Pick the members by which causes were found that none of those known stands for."""
    missing = {*names} - {m.candidate.effect for m in known}
    return tuple(m for m in found.mean if m.candidate.effect in missing)


def _before_law(state: State, found: Assessment, further: State) -> _BeforeLaw | None:
    """Remember what a law at edges is to explain that has another name or none; None where nothing.

    What stands for a law itself is explained as far as the law gains.
    """
    if len(further.causes) == len(state.causes) or not is_law(further.causes[-1]):
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
    good: Good,
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
        return seen_again(state, replace(state.model, curve=curve), causes, good)
    if not new:
        return None
    (cause,) = new
    if is_law(cause):
        at_edges = weighed_at_edges(state, found, good, progress)
        return by_law_at_edges(state, found, at_edges, cause, good, notes)
    return by_law(state, found, cause, good, notes, progress)


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
