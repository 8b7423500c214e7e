"""Search over causes of the scale, the losses and the outliers, weighed by Laplace."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp

from diagnosis.evidence.glm import Mode, Responses, mode
from diagnosis.evidence.habit import Habit
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_channels import Channel, RateCandidate, RateVariant
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RateMember:
    """A cause found in a channel.

    Attributes
    ----------
    gain : by how much that change makes the readings more probable, nats
    change : (N,) of the predictor at the mode, for the readings that take part
    """

    candidate: RateCandidate
    channel: str
    variant: int
    size: float
    nats: float
    shares: Mapping[str, float]
    gain: float
    change: Floats


def _one_sided(factor: float, found: Mode, size: float, fall: float) -> float:
    """Log Bayes factor where the last coefficient can only be positive.

    Its prior is the positive half, twice as dense. Where the likelihood falls from zero on, it
    does so exponentially, and the integral is that of the fall.

    Parameters
    ----------
    factor : of both signs
    fall : minus the slope of the log likelihood at zero
    """
    if fall <= 0:
        return float(factor + np.log(2.0) + log_ndtr(found.coefficients[-1] / found.sd[-1]))
    return float(min(0.0, np.log(2.0 / (np.sqrt(2 * np.pi) * size * fall))))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Sized:
    """Log Bayes factors of a candidate's sizes, over its variants, and its likeliest form.

    Attributes
    ----------
    factors : (S,)
    gain : by how much the mode makes the readings more probable than their level alone, nats
    coefficients : (k,) at the mode, of the columns whatever their size
    root : (k, j) R of their covariance R R'
    change : (N,) of the predictor there
    """

    factors: Floats
    gain: float
    variant: int
    size: float
    coefficients: Floats
    root: Floats
    change: Floats

    @property
    def stands_out(self) -> bool:
        """Whether some size is more probable than none by a nat."""
        return bool(self.factors.max() >= SETTINGS.stands_out)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Weighed:
    nats: float
    usual: float
    gain: float
    variant: int
    size: float
    change: Floats


class RateSearch:
    """Search over causes of one channel, one after the other."""

    def __init__(
        self, channel: Channel, scales: Scales, withheld: frozenset[str] = frozenset()
    ) -> None:
        self.channel, self.scales, self.withheld = channel, scales, withheld

    def sizes(self, responses: Responses, candidate: RateCandidate) -> Sized:
        """Weigh each size of a candidate against none."""
        sizes, free = SETTINGS.rate_sizes(), self.channel.level_sd
        factors = np.zeros((len(candidate.variants), len(sizes)))
        # of the likeliest alone the mode is kept: its covariance is as large as columns are many
        best: tuple[float, int, float, float, Mode] | None = None
        for i, variant in enumerate(candidate.variants):
            cells = responses.in_cells(variant.owner, variant.count)
            base = mode(cells, variant.level, free)
            level, slope, _ = cells.likelihood(variant.level @ base.coefficients)
            fall = -float(variant.columns[:, -1] @ slope)
            x = np.concatenate([variant.level, variant.columns], axis=1)
            start = np.concatenate([base.coefficients, np.zeros(variant.columns.shape[1])])
            for k, size in enumerate(sizes):
                sd = np.concatenate([free, np.full(variant.columns.shape[1], size)])
                found = mode(cells, x, sd, start)
                factors[i, k] = found.log_evidence - base.log_evidence
                start = found.coefficients
                if candidate.component.relaxed.grows:
                    factors[i, k] = _one_sided(factors[i, k], found, size, fall)
                if best is None or factors[i, k] > best[0]:
                    gain = cells.likelihood(x @ found.coefficients)[0] - level
                    best = factors[i, k], i, float(size), gain, found
        assert best is not None
        _, v, size, gain, at = best
        variant = candidate.variants[v]
        coefficients = at.coefficients[len(free) :] / variant.size
        return Sized(
            factors=np.asarray(logsumexp(factors - np.log(len(factors)), axis=0)),
            gain=gain, variant=v, size=size,
            coefficients=coefficients, root=at.root[len(free) :] / variant.size,
            change=variant.change(coefficients),
        )  # fmt: skip

    def as_recorded(
        self, responses: Responses, doubts: Sequence[RateVariant]
    ) -> tuple[Responses, float]:
        """Move responses by what baselines leave open, and weigh that against moving nothing.

        Returns
        -------
        the responses as they were, and 0, where nothing speaks for it
        """
        nats = 0.0
        for doubt in doubts:
            level, free = doubt.level, self.channel.level_sd
            cells = responses.in_cells(doubt.owner, doubt.count)
            x = np.concatenate([level, doubt.columns], axis=1)
            found = mode(cells, x, np.concatenate([free, np.ones(doubt.columns.shape[1])]))
            gain = found.log_evidence - mode(cells, level, free).log_evidence
            if gain > 0:
                nats += gain
                responses = responses.moved(doubt.change(found.coefficients[len(free) :]))
        return responses, nats

    def weigh(
        self,
        responses: Responses,
        candidates: Sequence[RateCandidate],
        explained: float = 0.0,
        doubted: float = 0.0,
    ) -> tuple[dict[str, _Weighed], RateCandidate | None]:
        """Weigh candidates, each against a good instrument, by name.

        No law is exact: what follows nearly the same curve as the best is as good, but for what
        it pays for its freedom. That holds for what a good instrument has as well as for a cause,
        and for what the laws before leave.

        Parameters
        ----------
        explained : size of what the responses were moved by
        doubted : log evidence of what baselines leave open

        Returns
        -------
        candidates by name; what a good instrument has that explains most by itself, None where
        that is no more than chance
        """
        made = {c.name: self.sizes(responses, c) for c in candidates}
        if not made:
            return {}, None
        best = max(made.values(), key=lambda one: float(one.factors.max()))
        alike, left = (
            responses.information() * (SETTINGS.doubt_of_rates * size) ** 2 / 2
            for size in (best.size, explained)
        )
        found: dict[str, _Weighed] = {}
        nothing, usual = left + doubted, None
        shown = nothing + SETTINGS.stands_out
        for c in candidates:
            one = made[c.name]
            less = float(best.factors.max() - one.factors.max())
            misfit = max(best.gain - one.gain, 0.0)
            factors = one.factors + min(alike, less, misfit)
            quiet = np.log(np.maximum(self.scales.of(c.key), 1e-300))
            good = float(logsumexp(factors + quiet))
            nothing = max(nothing, good)
            # as good as another one, it need not explain anything: taken as given it would leave
            # what that explains, and nothing to hold it against
            itself = float(logsumexp(one.factors + quiet))
            if itself >= shown:
                shown, usual = itself, c
            found[c.name] = _Weighed(
                usual=itself, nats=float(logsumexp(factors + np.log(self.scales.changed(c.key)))),
                gain=one.gain, variant=one.variant, size=one.size, change=one.change,
            )  # fmt: skip
        weighed = {n: replace(w, nats=w.nats - nothing) for n, w in found.items()}
        return weighed, usual

    def _beside(
        self, responses: Responses, usual: RateCandidate, as_weighed: _Weighed
    ) -> Responses:
        """Move responses by what a good instrument has of a component, its level included.

        What changes losses or noise somewhere by so much may change all of them by as much.
        """
        variant = usual.variants[as_weighed.variant]
        x = np.concatenate([variant.level, variant.columns], axis=1)
        level_sd = np.hypot(self.channel.level_sd, as_weighed.size)
        sd = np.concatenate([level_sd, np.full(variant.columns.shape[1], as_weighed.size)])
        found = mode(responses.in_cells(variant.owner, variant.count), x, sd)
        return responses.moved((x @ found.coefficients)[variant.owner])

    def search(self) -> tuple[list[RateMember], list[Habit]]:
        """Find causes until none at all is likelier, beside what a good instrument has.

        Returns
        -------
        causes; what good instruments have that the readings show beside them
        """
        responses = self.channel.responses
        found: list[RateMember] = []
        habits: list[Habit] = []
        explained, doubts = 0.0, self.channel.doubts
        free = [
            c.unclaimed() if c.component.effect in self.withheld else c
            for c in self.channel.candidates
        ]
        while len(found) < SETTINGS.most_causes:
            recorded, doubted = self.as_recorded(responses, doubts)
            weighed, usual = self.weigh(responses, free, explained, doubted)
            odds = {c.name: weighed[c.name].nats + SETTINGS.log_odds(c.component.effect)
                    for c in free}  # fmt: skip
            best = max(free, key=lambda c: odds[c.name], default=None)
            total = logsumexp([0.0, *odds.values()])
            if best is None or np.exp(-total) >= SETTINGS.reported:
                if usual is None:
                    if doubted < SETTINGS.stands_out:
                        break
                    responses, doubts = recorded, ()
                    continue
                w = weighed[usual.name]
                habits.append(Habit(
                    name=usual.name, component=usual.component, size=w.size, nats=w.usual,
                    fault=float(-np.expm1(-total)),
                ))  # fmt: skip
                responses = self._beside(responses, usual, w)
                explained = float(np.hypot(explained, w.size))
                free = [c for c in free if c is not usual]
                continue
            shares = {n: float(np.exp(x - total)) for n, x in odds.items()}
            w = weighed[best.name]
            found.append(RateMember(
                candidate=best, channel=self.channel.name, variant=w.variant, size=w.size,
                nats=w.nats, shares={**shares, "": float(np.exp(-total))}, gain=w.gain,
                change=w.change,
            ))  # fmt: skip
            responses = responses.moved(w.change)
            explained = float(np.hypot(explained, w.size))
            free = [c for c in free if c is not best]
        return found, habits


def in_turn(channel: Channel) -> Iterator[dict[str, Sized]]:
    """Weigh all candidates; take the likeliest as given, and weigh all again while one stands out.

    What baselines leave open is taken as given, too, once it explains more than any candidate;
    before, a candidate counts by what it explains beyond that.

    Yields
    ------
    each candidate by its key; the last beside all that stands out
    """
    search = RateSearch(channel, Scales(sizes=SETTINGS.rate_sizes(), weights={}))
    responses, waiting = channel.responses, {c.key: c for c in channel.candidates}
    doubts = channel.doubts
    while waiting:
        found = {key: search.sizes(responses, c) for key, c in waiting.items()}
        recorded, doubted = search.as_recorded(responses, doubts)
        if doubted > 0:
            beside = {key: search.sizes(recorded, c) for key, c in waiting.items()}
            if doubted >= found[likeliest(found)].factors.max():
                responses, doubts, found = recorded, (), beside
            else:
                most = {k: np.maximum(one.factors - doubted, beside[k].factors)
                        for k, one in found.items()}  # fmt: skip
                found = {k: replace(one, factors=most[k]) for k, one in found.items()}
        yield found
        best = likeliest(found)
        if not found[best].stands_out:
            break
        responses = responses.moved(found[best].change)
        del waiting[best]


def likeliest(found: Mapping[str, Sized]) -> str:
    """Return the key of the candidate that explains most."""
    return max(found, key=lambda key: float(found[key].factors.max()))
