"""Causes weighed on the readings held out as well.

Nothing is fitted to these. What they add to the evidence of a cause is how well it predicts them,
given the fitted ones: the coefficients of a curve are integrated, a law of light at edges stays as
it was fitted. They decide between causes that the fitted readings can't tell apart, and speak
against one that was there by chance.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

from diagnosis.data.patch import all_fitted
from diagnosis.evidence.assess import weighed_again
from diagnosis.evidence.mean_causes import Member
from diagnosis.evidence.reported_causes import Cause, shares_by_effect
from diagnosis.evidence.seen import Seen, seen, together
from diagnosis.explanation import Explanation, under
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.assumed_camera import seen_by
from diagnosis.physics.joint_fit import fit_laws
from diagnosis.physics.laws_at_edges import nats_of_law
from diagnosis.prepare import Prepared
from diagnosis.settings import SETTINGS


def weighed_on_all(
    explanation: Explanation, ready: Prepared, withheld: frozenset[str]
) -> tuple[Explanation, list[str]]:
    """Weigh causes on all readings; where another one is likelier, fit that.

    Returns
    -------
    the explanation; names of causes that are unlikely, where there are some: it stands as it was,
    to be made again without them
    """
    causes = _by_curves(_by_laws(explanation, ready), explanation, ready, withheld)
    pairs = list(zip(explanation.causes, causes, strict=True))
    unlikely = [was.name for was, c in pairs if 1 - c.none_of_these <= SETTINGS.reported]
    if unlikely:
        return explanation, unlikely
    renamed = [c for was, c in pairs if was.name != c.name]
    if not renamed:
        return replace(explanation, causes=tuple(causes)), []
    names = {c.name for c in causes}
    lost = [c.name for c in explanation.causes if c.name not in names]
    model, fitted = fit_laws(renamed, explanation.ws, explanation.model.without(*lost))
    by_name = {c.name: c for c in fitted}
    decided = replace(explanation, causes=tuple(by_name.get(c.name, c) for c in causes))
    return under(model, decided, ready), []


def _by_laws(explanation: Explanation, ready: Prepared) -> list[Cause]:
    """Let laws of light at edges be as probable as all readings make them, or less.

    A law that isn't nature's may lose on some readings what it gains on others. What it gains on
    all of them is its size, of which a good instrument has some, too.
    """
    sheet, noise = explanation.recorded.datasheet, ready.noise
    effects = {e.name: e for e in explanation.model.effects}
    causes: list[Cause] = []
    for cause in explanation.causes:
        law, effect = cause.component, effects.get(cause.name)
        at_edges = law is not None and law.relaxed.spanned and not cause.off_edges
        if effect is None or law is None or cause.channel != "mean" or not at_edges:
            causes.append(cause)
            continue
        nats = nats_of_law(
            law, effect,
            Workspace.build(all_fitted(seen_by(ready.patches, sheet)), noise),
            explanation.model.without(cause.name),
            Workspace.build(seen_by(ready.baseline, sheet), noise) if ready.baseline else None,
            explanation.scales,
            explained=math.hypot(*(c.size for c in explanation.causes if c is not cause)),
        )  # fmt: skip
        if nats is not None:
            probability = SETTINGS.probability(nats, cause.name)
            cause = replace(cause.at_most(probability), on_all=True)
        causes.append(cause)
    return causes


def _by_curves(
    causes: Sequence[Cause], explanation: Explanation, ready: Prepared, withheld: frozenset[str]
) -> list[Cause]:
    """Share the probability of each cause that a curve shows anew, as all readings weigh it."""
    places = {c.name: m for c in causes for m in _places(c, explanation.members)}
    if not places:
        return list(causes)
    now, before = _all_seen(explanation.first, ready), explanation.before
    members = weighed_again(
        explanation.members, now, explanation.departures if before is None else explanation.scales,
        before, departures=explanation.departures, withheld=withheld,
        refuted=explanation.refuted,
    )  # fmt: skip
    again = {m.candidate.name: m for m in members}
    shared: list[Cause] = []
    for cause in causes:
        place = places.get(cause.name)
        anew = None if place is None else again.get(place.candidate.name)
        others = {c.name for c in causes if c is not cause} | {c.name for c in shared}
        shared.append(cause if anew is None else _shared_anew(cause, anew, members, now, others))
    return shared


def _all_seen(first: Seen, ready: Prepared) -> Seen:
    """Look at the readings held out as well, in the components of those fitted.

    Of one recording alone all readings are looked at anew: its blocks have one placement.
    """
    if ready.single:
        return seen(all_fitted(ready.patches), ready.noise, Model(), like=first)
    held = all_fitted([p for p in ready.patches if not p.fit.any()])
    return together([first, seen(held, ready.noise, Model(), like=first)], ready.patches)


def _places(cause: Cause, members: Sequence[Member]) -> list[Member]:
    """Return the member in whose place a cause and its alternatives were weighed, if off edges.

    At edges laws of light are compared as they are fitted.
    """
    names = {cause.name, *(n for n, _ in cause.alternatives)}
    if cause.channel != "mean":
        return []
    found = [m for m in members if m.candidate.effect in names]
    return [m for m in found[:1] if not m.candidate.at_edges]


def _shared_anew(
    cause: Cause, member: Member, members: Sequence[Member], now: Seen, others: Collection[str]
) -> Cause:
    """Share the probability of a cause and its alternatives as all readings weigh them.

    Others of the set keep their names. One that wasn't offered has the place where it is more
    probable than not.

    Parameters
    ----------
    others : names of the other causes, which stay alternatives
    """
    effects = {c.name: c.effect for c in now.candidates}
    named, rest = shares_by_effect(member.shares, effects)
    if cause.name not in named:
        return cause
    taken = {m.candidate.effect for m in members if m is not member}
    rest += sum(named.pop(n, 0.0) for n in taken)
    order = sorted(named, key=lambda n: -named[n])
    offered = {n for n, _ in cause.alternatives}
    may = {n for n in order if n in offered or named[n] > SETTINGS.reported}.difference(others)
    best = next(n for n in order if n == cause.name or n in may)
    ways = [c for c in now.candidates if c.effect == best and c.name in member.odds]
    likeliest = max(ways, key=lambda c: member.odds[c.name])
    component = cause.component if best == cause.name else likeliest.component
    return replace(
        cause, name=best, probability=named[best], none_of_these=rest, component=component,
        on_all=True,
        alternatives=tuple(
            (n, named[n]) for n in order if n != best and named[n] > SETTINGS.offered
        ),
    )  # fmt: skip
