"""Causes as they are reported: a name with its probability, and what else it could be."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from diagnosis.components.component import Component
from diagnosis.evidence.assess import Assessment
from diagnosis.settings import SETTINGS
from sensors.effects import CATALOGUE
from sensors.effects.relaxed import Relaxed
from sensors.view.covariates import COVARIATES


@dataclass(frozen=True, kw_only=True, slots=True)
class Cause:
    """One catalogued cause.

    Attributes
    ----------
    name : of the effect
    channel : of the law of a reading by which it was found
    probability : of this name, the other causes given
    alternatives : other names with their probabilities, likeliest first
    none_of_these : probability that it is no catalogued effect, or nothing at all
    nats : log Bayes factor of the component against a good instrument
    gain : by how much the component makes the readings more probable, nats; 0 where not known
    size : of the component, whitened rms
    repeats : frequency (of what repeats) found; 0 for others
    component : by which it was found
    unsure : relative standard deviation of the law's strength, by what good instruments have
    on_all : whether readings held out have weighed its component as well
    off_edges : whether readings off edges show it, where good instruments have little of any law
    doubt : what speaks against the law, not against the cause; "" for nothing
    """

    name: str
    channel: str
    probability: float
    alternatives: tuple[tuple[str, float], ...]
    none_of_these: float
    nats: float
    gain: float = 0.0
    size: float = 0.0
    repeats: float = 0.0
    component: Component | None = None
    unsure: float = 0.0
    on_all: bool = False
    off_edges: bool = False
    doubt: str = ""

    @property
    def shown_again(self) -> bool:
        """Whether readings held out show it, too, and by more than the likeliest curve.

        Columns of a law off edges are a curve's: what they show is the law's or another's.
        """
        curve = self.component is None or self.component.is_curve or self.off_edges
        return self.on_all and not curve

    def doubted(self, why: str) -> "Cause":
        """Return the cause with a doubt about its law, each said once."""
        if why in self.doubt:
            return self
        return replace(self, doubt=f"{self.doubt} {why}".strip())

    def at_most(self, probability: float) -> "Cause":
        """Return the cause where all names together are no likelier than that."""
        return self.times(min(1.0, probability / max(1 - self.none_of_these, 1e-9)))

    def times(self, share: float) -> "Cause":
        """Return the cause where that share of the probability of all names together is left."""
        return replace(
            self, probability=share * self.probability,
            alternatives=tuple((name, share * p) for name, p in self.alternatives),
            none_of_these=1 - share * (1 - self.none_of_these),
        )  # fmt: skip

    def unnamed(self) -> "Unexplained":
        """Return the component that it was found by, without a cause."""
        return Unexplained(
            component=self.name if self.component is None else self.component.name,
            channel=self.channel, probability=self.probability, nats=self.nats, size=self.size,
            repeats=self.repeats, effect=self.name,
            relaxed=None if self.component is None else self.component.relaxed,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Unexplained:
    """A component that no catalogued effect claims.

    Attributes
    ----------
    size : whitened rms (mean), or rms of the linear predictor (other channels)
    repeats : frequency or place of its form, where it has one
    relaxed, effect : what it follows; of a law at edges, whose it is
    """

    component: str
    channel: str
    probability: float
    nats: float
    size: float
    repeats: float = 0.0
    relaxed: Relaxed | None = None
    effect: str = ""

    @property
    def follows(self) -> tuple[str, ...]:
        """Covariates that it goes with; a law at edges goes with what its effect does."""
        if self.relaxed is None:
            return ("time",)
        if self.relaxed.spanned:
            return (CATALOGUE[self.effect].covariate if self.effect else "edge_y",)
        if self.relaxed.each == "column":
            return ("column",)
        return self.relaxed.along or ("time",)

    @property
    def of_surface(self) -> bool:
        """Whether it may be the surface's: what goes with time, profiles or columns is not."""
        if self.relaxed is None or self.relaxed.each:
            return False
        return all(COVARIATES[name].frame == "part" for name in self.relaxed.along)


def usual_components(assessment: Assessment) -> list[Unexplained]:
    """List what good instruments have as well; `probability` that it is a fault all the same."""
    return [
        Unexplained(
            component=habit.name, channel=habit.component.relaxed.channel, nats=habit.nats,
            size=habit.size, probability=habit.fault, repeats=habit.repeats,
            relaxed=habit.component.relaxed, effect=habit.component.effect,
        )
        for habit in assessment.usual if not habit.component.placement
    ]  # fmt: skip


def unnamed(causes: Iterable[Cause]) -> list[Unexplained]:
    """Take names back: unknown components are left, where they are likelier than nothing."""
    out = []
    for cause in causes:
        sure = SETTINGS.probability(cause.nats, "")
        if sure > SETTINGS.reported:
            out.append(replace(cause.unnamed(), probability=sure))
    return out


def shares_by_effect(
    shares: Mapping[str, float], effects: Mapping[str, str]
) -> tuple[dict[str, float], float]:
    """Sum probabilities by catalogued effect, and those of no effect."""
    named: dict[str, float] = {}
    rest = 0.0
    for component, share in shares.items():
        effect = effects.get(component, "")
        if effect:
            named[effect] = named.get(effect, 0.0) + share
        else:
            rest += share
    return named, rest


def offered_beside(best: str, named: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Pick what else a cause could be: what is likely enough, and what it takes to be told at all.

    All names in a place may be more probable than none while each by itself isn't: the set that is
    offered is.
    """
    found, total = [], named[best]
    for name in sorted(named.keys() - {best}, key=lambda n: (-named[n], n)):
        if named[name] <= SETTINGS.offered and total > SETTINGS.reported:
            break
        found.append((name, named[name]))
        total += named[name]
    return tuple(found)


def offered_in_turn(cause: Cause) -> Iterator[Cause]:
    """Yield a cause and each alternative, as probable as it is once those before are refuted.

    As long as all that are left together are more probable than none of them.
    """
    yield cause
    refuted = cause.probability
    for k, (name, probability) in enumerate(cause.alternatives):
        left = 1.0 - refuted
        if cause.none_of_these >= (1.0 - SETTINGS.reported) * left:
            return
        yield replace(
            cause, name=name, probability=probability / left, component=None,
            alternatives=tuple((n, p / left) for n, p in cause.alternatives[k + 1 :]),
            none_of_these=cause.none_of_these / left,
        )  # fmt: skip
        refuted += probability


def reported(assessment: Assessment) -> tuple[list[Cause], list[Unexplained]]:
    """Split what was found into catalogued causes and unknown physics.

    A place in the set is a catalogued effect's where the catalogued effects together are more
    probable than the unknown and nothing. How a recording lay and travelled is no mismatch: its
    placement takes that up.
    """
    causes: dict[str, Cause] = {}
    unexplained: list[Unexplained] = []
    for channel, member, shares, component in _members(assessment):
        named, rest = shares_by_effect(shares, assessment.effects[channel])
        if named and 1 - rest > SETTINGS.reported:
            order = sorted(named, key=lambda n: -named[n])
            own = component.effect if component.effect in named else order[0]
            best = own if named[own] >= named[order[0]] else order[0]
            cause = Cause(
                name=best, channel=channel, probability=named[best],
                alternatives=offered_beside(best, named), none_of_these=rest,
                nats=member.nats, gain=member.gain, size=member.size,
                repeats=member.repeats if best == component.effect else 0.0,
                component=component if best == component.effect else None,
                off_edges=(
                    best == component.effect and component.relaxed.spanned and not member.at_edges
                ),
            )  # fmt: skip
            if best not in causes or causes[best].nats < cause.nats:
                causes[best] = cause
        elif component.placement:
            continue
        elif not component.effect and 1 - shares.get("", 0.0) > SETTINGS.reported:
            unexplained.append(Unexplained(
                component=member.name, channel=channel, probability=1 - shares.get("", 0.0),
                nats=member.nats, size=member.size, repeats=member.repeats,
                relaxed=component.relaxed, effect=component.effect,
            ))  # fmt: skip
    return sorted(causes.values(), key=lambda c: (-c.size, -c.nats)), unexplained


def _members(
    assessment: Assessment,
) -> Iterable[tuple[str, "_Plain", Mapping[str, float], Component]]:
    for m in assessment.mean:
        label = m.candidate.labels[m.variant]
        plain = _Plain(
            name=m.candidate.name, nats=m.nats, gain=m.gain, size=m.size, repeats=label,
            at_edges=m.candidate.at_edges,
        )  # fmt: skip
        yield "mean", plain, m.shares, m.candidate.component
    for r in assessment.rates:
        plain = _Plain(
            name=r.candidate.name, nats=r.nats, gain=0.0, size=r.size, repeats=0.0, at_edges=True
        )  # fmt: skip
        yield r.channel, plain, r.shares, r.candidate.component


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plain:
    name: str
    nats: float
    gain: float
    size: float
    repeats: float
    at_edges: bool


def not_yet_named(causes: Sequence[Cause], known: Sequence[str]) -> list[Cause]:
    """Return the causes whose names aren't known already."""
    return [c for c in causes if c.name not in known]
