"""Which causes the readings need: a search over sets by evidence, and probabilities.

A cause is present where the evidence for a change of its component beats the evidence for what a
good instrument has of it. Sets grow by the cause with the largest posterior odds; each member is
then weighed against its absence and against every other cause in its place, the rest kept. These
conditional weights are the reported probabilities; causes that share them can't be told apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from diagnosis.evidence.candidates import Candidate
from diagnosis.evidence.posterior import Equations, Posterior, Term
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

    def typical(self, name: str) -> float:
        """Return the root mean square size."""
        return float(np.sqrt((self.of(name) * self.sizes**2).sum()))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Member:
    """One cause of a set.

    Attributes
    ----------
    variant, size : most probable form, and its size (whitened rms)
    nats : log Bayes factor against its absence
    shares : probability of each candidate in its place, by name; "" is none at all
    """

    candidate: Candidate
    variant: int
    size: float
    nats: float
    shares: Mapping[str, float]

    @property
    def term(self) -> Term:
        """Return its term."""
        return self.candidate.term(self.variant)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Weighed:
    """A candidate beside a set: log Bayes factor and most probable form."""

    nats: float
    variant: int
    size: float


class CauseSearch:
    """Search over sets of candidates on given equations."""

    def __init__(
        self,
        found: Equations,
        readings: int,
        candidates: Sequence[Candidate],
        scales: Scales,
        baseline: Equations | None = None,
        *,
        explained: float = 0.0,
    ) -> None:
        self._explained = explained
        self.found, self.readings, self.candidates = found, readings, list(candidates)
        self.scales, self.baseline = scales, baseline
        size = len(found.right)
        self._quiet = np.full(size, scales.sizes[0])
        for c in candidates:
            if c.shapes[0] is None:
                self._quiet[c.at] = np.maximum(self._quiet[c.at], scales.typical(c.name))

    def posterior(self, active: Sequence[tuple[Candidate, int, float]]) -> Posterior:
        """Posterior with a set; a large signal is no better known than by a few per cent."""
        terms = [(c.term(v), s) for c, v, s in active]
        signal = np.sqrt(self._explained**2 + sum(s**2 for _, s in terms))
        quiet = np.hypot(self._quiet, SETTINGS.doubt * signal)
        return Posterior(self.found, quiet, terms, self.baseline)

    def weigh(self, posterior: Posterior, candidate: Candidate) -> Weighed:
        """Weigh one more candidate beside a set."""
        sizes = self.scales.sizes
        factors = candidate.log_factors(posterior.cavity(Term(at=candidate.at)), sizes)
        quiet = self.scales.of(candidate.name)
        each = factors - np.log(factors.size)
        # a good instrument has some of it as well
        usual = logsumexp(factors - np.log(len(factors)), axis=0, b=1.0)
        nothing = logsumexp(usual, b=np.maximum(quiet, 1e-300))
        variant, k = np.unravel_index(int(np.argmax(factors)), factors.shape)
        return Weighed(
            nats=float(logsumexp(each) - max(nothing, 0.0)), variant=int(variant),
            size=float(sizes[k]),
        )  # fmt: skip

    def log_odds(self, candidate: Candidate) -> float:
        """Log odds of a candidate before any reading."""
        return SETTINGS.log_odds(candidate.effect)

    def search(self) -> list[Member]:
        """Find the most probable set and weigh its members."""
        active: list[tuple[Candidate, int, float]] = []
        for _ in range(SETTINGS.most_causes):
            posterior = self.posterior(active)
            names = {c.name for c, _, _ in active if c.effect}
            scored = []
            for c in self.candidates:
                if c.name in names:
                    continue
                w = self.weigh(posterior, c)
                scored.append((w.nats + self.log_odds(c), w, c))
            if not scored:
                break
            odds, w, c = max(scored, key=lambda s: s[0])
            if odds <= 0:
                break
            active.append((c, w.variant, w.size))
            active = self._resized(active)
        return self._weighed(active)

    def _resized(self, active):
        out = list(active)
        for i, (c, _, _) in enumerate(out):
            if len(out) == 1:
                continue
            w = self.weigh(self.posterior(out[:i] + out[i + 1 :]), c)
            out[i] = (c, w.variant, w.size)
        return out

    def _weighed(self, active) -> list[Member]:
        members = []
        rest_names = [c.name for c, _, _ in active]
        for i, (c, v, s) in enumerate(active):
            posterior = self.posterior(active[:i] + active[i + 1 :])
            weights, forms = {"": 0.0}, {}
            for other in self.candidates:
                if other.name != c.name and other.name in rest_names:
                    continue
                w = self.weigh(posterior, other)
                weights[other.name] = w.nats + self.log_odds(other)
                forms[other.name] = w
            total = logsumexp(list(weights.values()))
            shares = {n: float(np.exp(x - total)) for n, x in weights.items()}
            members.append(
                Member(candidate=c, variant=v, size=s, nats=forms[c.name].nats, shares=shares)
            )
        return members
