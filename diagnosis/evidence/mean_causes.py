"""Which causes the readings need: a search over sets by evidence, and probabilities.

A cause is present where the evidence for a change of its component beats the evidence for what a
good instrument has of it. Sets grow by the cause with the largest posterior odds; where none beats
what good instruments have, by the component that they have and that explains most: whatever is
weighed next is weighed beside it. Each cause is then weighed against its absence and against every
other one in its place, the rest kept. These conditional weights are the reported probabilities;
causes that share them can't be told apart.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logsumexp

from diagnosis.evidence.candidates import Candidate
from diagnosis.evidence.changed_sizes import changed, usual
from diagnosis.evidence.habit import Habit
from diagnosis.evidence.posterior import Posterior, Posteriors, Term, World
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scales:
    """What good instruments have of each component.

    Attributes
    ----------
    sizes : (S,) grid of whitened rms
    weights : for each component's name (S,) probability of each size
    """

    sizes: Floats
    weights: Mapping[str, Floats]

    def of(self, name: str) -> Floats:
        """Return the probabilities of a component's sizes."""
        if name in self.weights:
            return self.weights[name]
        flat = np.zeros(len(self.sizes))
        flat[: SETTINGS.small_sizes] = 1.0 / SETTINGS.small_sizes
        return flat

    def deviations(self, candidates: Sequence[Candidate], count: int) -> dict[bool, Floats]:
        """Return what most good instruments stay below of each column's coefficient, (count,).

        Off edges (False), and given all readings (True): laws of light depart less where the
        surface runs on.
        """
        out = {edges: np.full(count, self.sizes[0]) for edges in (False, True)}
        for c in candidates:
            if c.shapes[0] is None:
                for edges in [c.at_edges] if c.component.relaxed.spanned else [False, True]:
                    out[edges][c.at] = np.maximum(out[edges][c.at], self.typical(c.key))
        return out

    def changed(self, name: str) -> Floats:
        """Return the probabilities of a change's size."""
        return changed(self.of(name))

    def nats(self, name: str, factors: Floats) -> float:
        """Log Bayes factor of a change, from those of its sizes (S,), against a good instrument."""
        return self.of_change(name, factors) - self.of_good(name, factors)

    def of_change(self, name: str, factors: Floats) -> float:
        """Log Bayes factor of a change of any size, from those of its sizes (S,)."""
        return float(logsumexp(factors + np.log(self.changed(name))))

    def of_good(self, name: str, factors: Floats) -> float:
        """Log Bayes factor of a good instrument: it has what most good ones have, or nothing."""
        return max(0.0, float(logsumexp(factors + np.log(np.maximum(self.of(name), 1e-300)))))

    def typical(self, name: str) -> float:
        """Return the size that most good instruments stay below."""
        return float(self.sizes[usual(self.of(name))])

    def rms(self, name: str) -> float:
        """Return the root of the mean square of a component's size in good instruments."""
        return float(np.sqrt(self.of(name) @ np.square(self.sizes)))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Member:
    """One cause of a set.

    Attributes
    ----------
    variant, size : most probable form, and its size (whitened rms)
    nats : log Bayes factor against its absence
    gain : by how much its most probable coefficients make the readings more probable, nats
    odds : log odds of each candidate in its place, by name, against none at all, which is ""
    coefficients : most probable ones of the candidate's columns, beside the other members
    """

    candidate: Candidate
    variant: int
    size: float
    nats: float
    gain: float
    odds: Mapping[str, float]
    coefficients: Floats

    @property
    def shares(self) -> dict[str, float]:
        """Probability of each candidate in its place, by name; "" is none at all."""
        total = logsumexp(list(self.odds.values()))
        return {n: float(np.exp(x - total)) for n, x in self.odds.items()}

    @property
    def term(self) -> Term:
        """Return its term."""
        return self.candidate.term(self.variant)


Active = tuple[Candidate, int, float]
"""A candidate in a set: with its variant and size."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Weighed:
    """A candidate beside a set: log Bayes factor and most probable form."""

    nats: float
    variant: int
    size: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Weighing:
    """Candidates beside a set.

    Attributes
    ----------
    causes : by name, each against a good instrument
    usual, habit : what a good instrument has that explains most, and how near it comes to a cause;
        None where that is no more than chance
    hides : whether beside it another candidate could have odds above one
    """

    causes: Mapping[str, Weighed]
    usual: Active | None
    habit: Habit | None
    hides: bool


class CauseSearch:
    """Search over sets of candidates.

    A law of light at edges is weighed on all readings; whatever else on those off edges, where a
    good instrument's readings are as good as its noise.
    """

    def __init__(
        self,
        worlds: Mapping[bool, World],
        candidates: Sequence[Candidate],
        scales: Scales,
        departures: Scales,
        *,
        explained: float = 0.0,
    ) -> None:
        """Set up a search.

        Parameters
        ----------
        worlds : equations off edges, and of all readings
        scales : of what is weighed in a good instrument: departures from the nominal model, or
            changes since its baselines
        departures : of the instrument, beside baselines
        explained : whitened rms of what the model explains already
        """
        self._worlds, self._explained = worlds, explained
        self.candidates, self.scales = list(candidates), scales
        columns = len(worlds[False].found.right)
        self._quiet = departures.deviations(candidates, columns)
        self._spanned = np.zeros(columns, dtype=bool)
        for c in candidates:
            self._spanned[c.at] |= c.component.relaxed.spanned

    def posteriors(
        self, active: Sequence[Active], tried: Sequence[Active] = ()
    ) -> Posteriors:
        """Posteriors with a set; a large signal is no better known than by a few per cent.

        Parameters
        ----------
        tried : what is weighed beside the set, whose law is doubted as well
        """
        terms = [(c.term(v), s) for c, v, s in active]
        # where a recording lay isn't a law that could be wrong
        laws = [s for c, _, s in (*active, *tried) if not c.component.placement]
        signal = self._explained**2 + sum(s**2 for s in laws)
        at_edges = sum(s**2 for c, _, s in active if c.component.relaxed.spanned)
        doubt = np.where(
            self._spanned, SETTINGS.doubt_at_edges * np.sqrt(at_edges),
            SETTINGS.doubt * np.sqrt(signal),
        )  # fmt: skip
        quiet = {edges: np.hypot(size, doubt) for edges, size in self._quiet.items()}
        return Posteriors(self._worlds, quiet, terms)

    def weigh(
        self, posteriors: Mapping[bool, Posterior], candidates: Sequence[Candidate]
    ) -> Weighing:
        """Weigh candidates beside a set, each against a good instrument.

        A good instrument departs in one of the components more than most do; the one that explains
        the readings best stands for it. Where there are baselines it departs as they do, and
        changes as good instruments do.
        """
        sizes = self.scales.sizes
        found: dict[str, tuple[float, int, float]] = {}
        nothing = 0.0
        usual: Active | None = None
        for c in candidates:
            factors, over = c.log_factors(posteriors[c.at_edges].cavity(Term(at=c.at)), sizes)
            quiet = np.log(np.maximum(self.scales.of(c.key), 1e-300))
            good = float(logsumexp(over + quiet))
            if good > nothing:
                nothing, usual = good, _likeliest(c, factors + quiet, sizes)
            nats = float(logsumexp(over + np.log(self.scales.changed(c.key))))
            _, variant, size = _likeliest(c, factors, sizes)
            found[c.name] = nats, variant, size
        hidden = usual is not None and any(
            found[c.name][0] + self.log_odds(c) > 0
            for c in candidates if _cause(c) != _cause(usual[0])
        )  # fmt: skip
        causes = {
            n: Weighed(nats=nats - nothing, variant=v, size=s)
            for n, (nats, v, s) in found.items()
        }
        if usual is None or nothing < SETTINGS.stands_out:
            return Weighing(causes=causes, usual=None, habit=None, hides=hidden)
        odds = max(causes[c.name].nats + self.log_odds(c) for c in candidates)
        c, variant, size = usual
        habit = Habit(
            name=c.name, component=c.component, size=size, nats=nothing, fault=float(expit(odds)),
            repeats=c.labels[variant],
        )  # fmt: skip
        return Weighing(causes=causes, usual=usual, habit=habit, hides=hidden)

    def log_odds(self, candidate: Candidate) -> float:
        """Log odds of a candidate before any reading."""
        return SETTINGS.log_odds(candidate.effect)

    def search(self) -> tuple[list[Member], list[Habit]]:
        """Find the most probable set and weigh its members.

        Returns
        -------
        members; what good instruments have that the readings show beside them, as far as it was
        asked for
        """
        active: list[Active] = []
        usual: list[Active] = []
        habits: list[Habit] = []
        while len(active) < SETTINGS.most_causes:
            best, weighing = self._best([*usual, *active])
            if best is not None:
                active.append(best)
                if best[0].component.relaxed.spanned:
                    break  # a few points of its grid aren't its law: fit that before going on
                active = self._resized(active, usual)
                continue
            if weighing.habit is not None:
                habits.append(weighing.habit)
            if weighing.usual is None or not weighing.hides:
                break
            usual.append(weighing.usual)
            active = self._standing(active, usual)
        return self.weighed(active, usual), habits

    def _standing(self, active: Sequence[Active], usual: Sequence[Active]) -> list[Active]:
        """Drop the members that what a good instrument has explains, the least likely first."""
        out = list(active)
        while out:
            odds = [m.nats + self.log_odds(m.candidate) for m in self.weighed(out, usual)]
            worst = int(np.argmin(odds))
            if odds[worst] > 0:
                break
            del out[worst]
        return out

    def usual_beside(self, active: Sequence[Active]) -> list[Active]:
        """List what a good instrument has beside a set, one after the other."""
        usual: list[Active] = []
        while True:
            beside = [*usual, *active]
            weighing = self.weigh(self.posteriors(beside), self._free(beside))
            if weighing.usual is None or not weighing.hides:
                return usual
            usual.append(weighing.usual)

    def _free(self, active: Sequence[Active]) -> list[Candidate]:
        """List the candidates whose causes aren't in a set."""
        taken = {_cause(c) for c, _, _ in active}
        return [c for c in self.candidates if _cause(c) not in taken]

    def _best(self, active: Sequence[Active]) -> tuple[Active | None, Weighing]:
        """Pick the candidate of the largest odds beside a set; None where none has any.

        Weighed alone it tells how large the signal is, and again with its law in doubt as much. One
        that is the likeliest then stands; where another one is, that is tried as well.

        Returns
        -------
        the candidate; the last weighing
        """
        free = self._free(active)
        weighing = self.weigh(self.posteriors(active), free)
        standing: dict[str, tuple[float, Active]] = {}
        tried: set[str] = set()
        while (best := self._leading(weighing, free)) and best[0].name not in tried:
            name = best[0].name
            tried.add(name)
            weighing = self.weigh(self.posteriors(active, [best]), free)
            again = weighing.causes[name]
            odds = again.nats + self.log_odds(best[0])
            if odds > 0:
                standing[name] = odds, (best[0], again.variant, again.size)
        if best and best[0].name in standing:
            return standing[best[0].name][1], weighing
        if standing:
            return max(standing.values(), key=lambda one: one[0])[1], weighing
        return None, weighing

    def _leading(self, weighing: Weighing, free: Sequence[Candidate]) -> Active | None:
        """Return the candidate of the largest odds; None where none has odds above one."""
        odds = {c.name: weighing.causes[c.name].nats + self.log_odds(c) for c in free}
        best = max(free, key=lambda c: odds[c.name], default=None)
        if best is None or odds[best.name] <= 0:
            return None
        return best, weighing.causes[best.name].variant, weighing.causes[best.name].size

    def _resized(self, active: Sequence[Active], usual: Sequence[Active]) -> list[Active]:
        """Give each member the size and form that suit it best beside the others."""
        out = list(active)
        for i, (c, _, _) in enumerate(out):
            if len(out) > 1:
                beside = self.posteriors([*usual, *out[:i], *out[i + 1 :]])
                w = self.weigh(beside, [c]).causes[c.name]
                out[i] = (c, w.variant, w.size)
        return out

    def weighed(self, active: Sequence[Active], usual: Sequence[Active]) -> list[Member]:
        """Weigh each member of a set against its absence and each other cause in its place.

        Parameters
        ----------
        usual : what a good instrument has beside them
        """
        which = {c.at_edges for c, *_ in active}
        whole = self._coefficients([*usual, *active], which)
        return [
            self._member(one, [*usual, *active[:i], *active[i + 1 :]], whole[one[0].at_edges])
            for i, one in enumerate(active)
        ]

    def _coefficients(
        self, active: Sequence[Active], which: Collection[bool]
    ) -> dict[bool, Floats]:
        """Most probable coefficients of all columns beside a set, by choice of readings."""
        posteriors = self.posteriors(active)
        return {edges: posteriors[edges].coefficients() for edges in which}

    def _member(self, one: Active, rest: Sequence[Active], coefficients: Floats) -> Member:
        """Weigh one of a set beside the rest.

        Parameters
        ----------
        coefficients : of all columns
        """
        c, variant, size = one
        free, without = self._free(rest), self.posteriors(rest, [one])
        weighed = self.weigh(without, free).causes
        odds = {o.name: weighed[o.name].nats + self.log_odds(o) for o in free} | {"": 0.0}
        return Member(
            candidate=c, variant=variant, size=size, nats=weighed[c.name].nats, odds=odds,
            gain=without[c.at_edges].cavity(c.term(variant)).gain(size),
            coefficients=coefficients[c.at],
        )  # fmt: skip


def _likeliest(candidate: Candidate, factors: Floats, sizes: Floats) -> Active:
    """Pick the form and size of the largest log factor (V, S)."""
    variant, k = np.unravel_index(int(np.argmax(factors)), factors.shape)
    return candidate, int(variant), float(sizes[k])


def _cause(candidate: Candidate) -> str:
    """Name what a candidate is a form of: one form of it is in a set at most."""
    return candidate.effect or candidate.name
