"""What good instruments have of each component: learnt from a named calibration population.

`discrepancy.json` holds kinds of instruments and, for each component of each kind, the probability
of each size of a grid: a lognormal distribution over instruments, fitted to the likelihood of the
sizes in each one's recordings; and the same of changes, in recordings beside an earlier one of the
instrument and the part. A share of changes comes anew: the instrument departs by as much as before,
but in another way. The others are small, and of sizes of their own. Where an instrument has changed
before, its next change is like that one in a share of instruments (`alike`).
`python -m benchmarks.discrepancy` makes it.

Which kind an instrument is of, its own recordings tell: where one has none of the locking, bow and
slips that all of a kind have, it isn't of that kind (a mixture; Gelman et al., Bayesian Data
Analysis, 2013, ch. 22). What its mean is like off edges says nothing of its noise, its losses or
its light at edges: of these each tells a kind of its own (`aspect_of`).
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.component import components_of, stated, unlisted
from diagnosis.evidence.changed_sizes import changed
from sensors.effects.relaxed import Relaxed

Floats = NDArray[np.float64]
T = TypeVar("T")
Shares = Mapping[str, Floats]
"""Probability of each kind (kinds,), by aspect."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Kind:
    """A kind of instruments.

    Attributes
    ----------
    name : of the recordings that it was learnt from
    weights : for each component's name, probability of each size
    changes : the same of what changes from one recording of an instrument and a part to another,
        where that doesn't come anew
    anew : by component, how often an instrument departs in another way the next time
    makes, instruments : how many it was learnt from
    columns : how its files say that columns lie, which decides about all but light at edges; ""
        for either way
    """

    name: str
    weights: Mapping[str, Floats]
    changes: Mapping[str, Floats] = field(default_factory=dict)
    anew: Mapping[str, float] = field(default_factory=dict)
    makes: int = 1
    columns: str = ""
    instruments: int = 1


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Population:
    """A named population, by kinds of instruments.

    Attributes
    ----------
    share : of instruments that are of a kind that was never seen; None for as the kinds say
    apart_by : by aspect, by how many doublings further sizes lie apart in such a kind
        (`spread_out`)
    alike : by aspect, how often an instrument's next change is as those before
    """

    kinds: tuple[Kind, ...]
    share: float | None = None
    apart_by: Mapping[str, float] = field(default_factory=dict)
    alike: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Names of its kinds."""
        return "; ".join(k.name for k in self.kinds)

    def weights(self, component: str) -> Floats | None:
        """Probabilities (kinds, sizes) of a component's sizes; None where no kind has its like.

        An instrument may be of a kind that was never seen. The share of that is one in K + 1 of K
        kinds (Laplace's rule of succession), however many makes they are of: makes of a kind are
        alike in what sets them apart from the next kind.
        """
        apart, share = self.apart(component), self.unlike(component)
        return None if apart is None else (1.0 - share) * apart[0] + share * apart[1]

    def apart(self, component: str) -> tuple[Floats, Floats] | None:
        """Probabilities of the sizes in known kinds (kinds, sizes), and in one never seen (sizes,).

        Of each component that has what known kinds have of any that is weighed alike, and so has a
        kind that was never seen to have it. None where no kind has its like.
        """
        like = self._like(component)
        if like is None:
            return None
        return np.stack([k.weights.get(component, like) for k in self.kinds]), like

    def unlike(self, component: str) -> float:
        """Return how often an instrument is of a kind that was never seen; see `weights`."""
        return 1.0 / (self._seen(component) + 1) if self.share is None else self.share

    def _seen(self, component: str) -> int:
        """Count the kinds that were seen to have a component.

        Where edges lie and how light is mixed there differs from make to make, and laws of light at
        edges tell it together: of these each law of each make counts. What files list as measured
        was measured on each instrument for itself: of these laws, each law of each instrument.
        """
        if not is_law_at_edges(component):
            return sum(component in k.weights for k in self.kinds)
        how = component.removeprefix(unlisted(component))
        names = {n for k in self.kinds for n in k.weights}
        alike = {n for n in names if n == unlisted(n) + how and is_law_at_edges(n)}
        measured = _measured(component)
        return sum(
            k.instruments if measured else k.makes
            for k in self.kinds for n in alike if n in k.weights
        )

    def _like(self, component: str) -> Floats | None:
        """Mean of the probabilities of all components that are weighed alike.

        In a kind that was never seen these lie further apart (`spread_out`). No law of light at
        edges is like another: an instrument of an unlike make has what changed ones have. No size
        is then more than M L + 1 times likelier in a changed one, of L laws of M makes. Where its
        maker lists the law as measured, it has no more than where only nominal numbers are stated.
        """
        where = _where(component)
        if is_law_at_edges(component) and _measured(component):
            less_known = stated(unlisted(component), "nominal")
            weights = self.weights(less_known)
            if weights is not None:
                return self.having(less_known, self._as_many_makes) @ weights
        like = [w for k in self.kinds for name, w in k.weights.items() if _where(name) == where]
        if not like:
            return None
        mean = np.asarray(np.mean(like, axis=0))
        if is_law_at_edges(component):
            return changed(mean)
        return spread_out(mean, self.apart_by.get(aspect_of(component), 0.0))

    def of_files(self, columns: str) -> "Population":
        """Keep kinds silent of all but light at edges whose files say otherwise of columns.

        A reading between two rays has less noise than one on a ray, is lost with either, and what
        interpolating leaves along the line is another in each recording.
        """

        def told(by: Mapping[str, T]) -> Mapping[str, T]:
            return {n: w for n, w in by.items() if aspect_of(n) == EDGES}

        return replace(self, kinds=tuple(
            k if k.columns in ("", columns)
            else replace(k, weights=told(k.weights), changes=told(k.changes), anew=told(k.anew))
            for k in self.kinds
        ))  # fmt: skip

    @property
    def of_changes(self) -> "Population":
        """The same kinds of instruments, by what changes in them.

        However unlike kinds are in what they depart by, they change by as little.
        """
        kinds = tuple(replace(k, weights=k.changes) for k in self.kinds)
        return replace(self, kinds=kinds, apart_by={})

    def anew(self, component: str) -> tuple[Floats, float]:
        """How often a component's change comes anew in known kinds (kinds,), in one never seen."""
        where = _where(component)
        like = [w for k in self.kinds for name, w in k.anew.items() if _where(name) == where]
        mean = float(np.mean(like)) if like else 0.0
        return np.array([k.anew.get(component, mean) for k in self.kinds]), mean

    def of_kinds(self, shares: Shares) -> dict[str, Floats]:
        """Probabilities of each component's sizes where kinds have these probabilities."""
        names = {n for k in self.kinds for n in k.weights}
        return {
            n: self.having(n, shares) @ w
            for n in sorted(names) if (w := self.weights(n)) is not None
        }  # fmt: skip

    def having(self, component: str, shares: Shares) -> Floats:
        """Probability of each kind (kinds,) of those that were seen to have a component.

        Where a kind's recordings never showed how it has one, the kind has no say.
        """
        own = shares[aspect_of(component)]
        told = own * [component in k.weights for k in self.kinds]
        return np.asarray(told / told.sum()) if told.sum() > 0 else own

    @property
    def makes(self) -> Floats:
        """How many makes each kind is of, (kinds,)."""
        return np.array([float(k.makes) for k in self.kinds])

    @property
    def _as_many_makes(self) -> Shares:
        """Probability of each kind before any reading: each make alike."""
        return dict.fromkeys(ASPECTS, self.makes / self.makes.sum())


def spread_out(weights: Floats, steps: float) -> Floats:
    """Draw sizes (S,) apart: lognormal, as those of a kind's instruments are.

    Parameters
    ----------
    steps : standard deviation, steps of the grid; 0 for none
    """
    if steps == 0:
        return weights
    apart = np.subtract.outer(np.arange(weights.size), np.arange(weights.size))
    drawn = np.exp(-0.5 * np.square(apart / steps))
    return np.asarray(drawn / drawn.sum(axis=0) @ weights)


LAW = "law"
"""Before the name of a law of light at edges whose own size it is."""
EDGES = "edges"
ASPECTS = ("mean", EDGES, "scale", "missing", "outliers")
"""What tells a kind, each by itself."""


def aspect_of(component: str) -> str:
    """Name what a component is an aspect of: the mean off edges, edges, or a channel."""
    channel = component.rpartition(": ")[0]
    if is_law_at_edges(component) or " at edges" in component:
        return EDGES
    return {"": "mean", "spectrum": "scale"}.get(channel, channel)


def is_law_at_edges(component: str) -> bool:
    """Whether a component is a law of light at edges whose own size it is."""
    return component.rpartition(": ")[0] == LAW


def tells_kind(component: str) -> bool:
    """Whether a component's size tells a kind.

    That of noise and losses that are free for each profile or column depends on how many there are.
    """
    relaxed = _relaxed(component)
    return aspect_of(component) in ("mean", EDGES) or relaxed is None or not relaxed.each


def _measured(component: str) -> bool:
    """Whether the sensor's file lists the effect of a component as measured."""
    return component == stated(unlisted(component), "listed")


def _relaxed(component: str) -> Relaxed | None:
    """Return the form of a component; None where its name is no component's."""
    channel, _, name = component.rpartition(": ")
    known = {c.name: c.relaxed for c in components_of(channel or "mean")}
    return known.get(unlisted(name).partition(" at ")[0])


@cache
def _where(component: str) -> tuple[str, ...]:
    """Tell with which components one is weighed alike: those of like values.

    Losses and outliers come where the light fails, on a few readings or on all of them, and laws of
    light at edges act on as many readings as the part has edges: no two are alike. Nor are values
    that are free for each profile or column and curves, where the noise follows them, nor noise
    along the line, of the sensor's light, and noise on slopes, of the surface.
    """
    channel, _, name = component.rpartition(": ")
    plain, relaxed = unlisted(name), _relaxed(component)
    if channel in ("missing", "outliers", LAW) or (relaxed is not None and relaxed.spanned):
        return channel, name
    if not channel or relaxed is None:
        return channel, "", "", name[len(plain) :]
    follows = relaxed.along[0] if relaxed.along else ""
    return channel, relaxed.each, follows, name[len(plain) :]


@cache
def population() -> Population:
    """Read the population that the project was calibrated on."""
    text = (files("diagnosis.discrepancy") / "discrepancy.json").read_text(encoding="utf-8")
    known = json.loads(text)
    return Population(
        apart_by=known["apart_by"],
        alike=known["alike"],
        kinds=tuple(
            Kind(
                name=kind["name"],
                weights={n: np.array(w) for n, w in kind["components"].items()},
                changes={n: np.array(w) for n, w in kind["changes"].items()},
                anew=kind["anew"],
                makes=kind["makes"],
                instruments=kind["instruments"],
                columns=kind["columns"],
            )
            for kind in known["kinds"]
        ),
    )
