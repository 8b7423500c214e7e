"""Scale, missing and outlier channels: the same candidates by relaxed form, weighed by Laplace.

What lies at depth edges has a level of its own in each channel, since there no law is exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label, uniform_filter
from scipy.special import log_ndtr, logsumexp

from diagnosis.calibration import USUAL_SHARE
from diagnosis.components.component import (
    Component,
    cell_of,
    components_of,
    missing_columns,
    plain_columns,
    seen_by_cameras,
)
from diagnosis.components.smooth import Ranges
from diagnosis.evidence.causes import Scales
from diagnosis.evidence.columns import column_groups
from diagnosis.evidence.glm import Mode, Owners, Responses, mode
from diagnosis.noise import Mask, NoiseModel
from diagnosis.patch import Patch
from diagnosis.prediction import Prediction
from diagnosis.score import Whitened
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
BLOCK, SURROUNDINGS = 5, 25
"""Readings a side of a block whose squares are summed, and of what it is compared with."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RateVariant:
    """One form of a component: cells of readings, and its columns there.

    Attributes
    ----------
    owner, count : cell of each reading, and how many cells there are
    level : (count, j) columns of the level
    columns : (count, k) of the component
    """

    owner: Owners
    count: int
    level: Floats
    columns: Floats


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RateCandidate:
    """One component of a channel on the readings taken, in one form or several.

    Attributes
    ----------
    listed : whether the sensor's file lists the effect
    """

    component: Component
    variants: tuple[RateVariant, ...]
    listed: bool = False

    def unclaimed(self) -> "RateCandidate":
        """Return the same as unknown physics."""
        return replace(self, component=replace(self.component, effect=""))

    @property
    def key(self) -> str:
        """Name under which the population of good instruments holds it."""
        own = f"{self.component.relaxed.channel}: {self.name}"
        return f"{own} (listed)" if self.listed else own

    @property
    def name(self) -> str:
        """Name of the component."""
        return self.component.name


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Channel:
    """Responses of one channel, and its candidates.

    Attributes
    ----------
    level_sd : deviations of the level, off edges and at them
    picks : for each patch, which readings take part
    """

    name: str
    responses: Responses
    level_sd: Floats
    candidates: tuple[RateCandidate, ...]
    picks: tuple[Mask, ...]


def channel_of(
    name: str,
    patches: Sequence[Patch],
    predictions: Sequence[Prediction],
    states: Sequence[Whitened],
    ranges: Ranges,
    noise: NoiseModel,
) -> Channel | None:
    """Gather a channel's responses and candidates; None where there are too few readings."""
    picks, responses = _responses(name, patches, predictions, states, noise)
    if responses.seen.size < SETTINGS.least_readings:
        return None
    edge = np.concatenate([p.edge[k] for p, k in zip(patches, picks, strict=True)])
    made = (_candidate(c, patches, picks, edge, ranges) for c in components_of(name))
    return Channel(
        name=name, responses=responses, level_sd=SETTINGS.level_sd(name),
        candidates=tuple(c for c in made if c is not None), picks=tuple(picks),
    )  # fmt: skip


def _responses(
    name: str,
    patches: Sequence[Patch],
    predictions: Sequence[Prediction],
    states: Sequence[Whitened],
    noise: NoiseModel,
) -> tuple[list[Mask], Responses]:
    picks, seen, usual, even = [], [], [], []
    loose = heads = 0
    for patch, law, state in zip(patches, predictions, states, strict=True):
        ambiguous = binary_dilation(patch.softness[1] > SETTINGS.ambiguous, iterations=1)
        near = patch.fit & patch.counted & law.seen & ~ambiguous
        if name == "scale":
            sharp = patch.softness[0] > SETTINGS.sharp * noise.sd_mm
            pick = near & state.used & ~patch.edge & ~sharp
            square = np.minimum(np.square(state.innovations), SETTINGS.clip**2)
            even.append(_block_sums(square, pick))
            value, number = square, np.ones(patch.shape)
        else:
            pick = near if name == "missing" else near & patch.observed
            event = pick & (~patch.observed if name == "missing" else ~state.used)
            number = law.p_missing if name == "missing" else law.p_outlier
            marks, _ = label(event, structure=np.ones((3, 3)))
            loose += int(event.sum())
            heads += int(marks.max(initial=0))
            value = event.astype(float)
        picks.append(pick)
        seen.append(value[pick])
        usual.append(np.asarray(number, dtype=np.float64)[pick])
    if name == "scale":
        # a Gaussian's square has variance 2; those of neighbours may go together
        sums = np.concatenate(even)
        dispersion = float(np.square(sums).mean()) / 2 if sums.size else 1.0
    else:
        dispersion = min(loose / max(heads, 1), SETTINGS.largest_clump)
    events, expected = np.concatenate(seen), np.concatenate(usual)
    if name != "scale":
        expected = _at_least_usual(events, expected)
    return picks, Responses(
        kind="scale" if name == "scale" else "rate", seen=events, usual=expected,
        dispersion=max(dispersion, 1.0),
    )  # fmt: skip


def _at_least_usual(events: Floats, expected: Floats) -> Floats:
    """Raise shares to what passes for noise, or to what there is where that is less.

    An instrument that loses fewer readings than most departs in nothing.
    """
    low = expected < USUAL_SHARE
    if not low.any():
        return expected
    share = min(USUAL_SHARE, (float(events[low].sum()) + 0.5) / int(low.sum()))
    return np.where(low, share, expected)


def _block_sums(square: Floats, pick: Mask) -> Floats:
    """Deviations of whole blocks' sums of squares from their surroundings', per root of reading."""
    inside = pick.astype(float)
    wide = np.maximum(uniform_filter(inside, SURROUNDINGS, mode="constant"), 1e-9)
    mean = uniform_filter(np.where(pick, square, 0.0), SURROUNDINGS, mode="constant") / wide
    relative = np.where(pick, square / np.maximum(mean, 1e-9) - 1, 0.0)
    n, m = (BLOCK * (k // BLOCK) for k in square.shape)
    shape = n // BLOCK, BLOCK, m // BLOCK, BLOCK
    sums = relative[:n, :m].reshape(shape).sum(axis=(1, 3))
    counts = inside[:n, :m].reshape(shape).sum(axis=(1, 3))
    whole = counts == BLOCK**2
    return np.asarray(sums[whole] / BLOCK)


def _candidate(
    component: Component,
    patches: Sequence[Patch],
    picks: Sequence[Mask],
    edge: Mask,
    ranges: Ranges,
) -> RateCandidate | None:
    relaxed = component.relaxed
    variants = []
    if relaxed.each:
        owner, count = _owners(relaxed.each, patches, picks)
        variants.append(_in_cells(owner, count, edge, np.eye(count)))
    elif relaxed.spanned:
        made = [missing_columns(component, p) for p in patches]
        for j in range(len(made[0])):
            lost = np.concatenate([m[j][k] for m, k in zip(made, picks, strict=True)]) > 0.5
            if lost.any():
                one = np.array([[0.0], [1.0]])
                variants.append(_in_cells(lost.astype(np.int64), 2, edge, one))
    else:
        for views in seen_by_cameras(component, patches):
            smooth = _smooth(component, views, picks, edge, ranges)
            if smooth is not None:
                variants.append(smooth)
    if not variants:
        return None
    listed = any(e.name == component.effect for e in patches[0].view.sensor.effects)
    return RateCandidate(component=component, variants=tuple(variants), listed=listed)


def _smooth(
    component: Component,
    patches: Sequence[Patch],
    picks: Sequence[Mask],
    edge: Mask,
    ranges: Ranges,
) -> RateVariant | None:
    """Sum readings over cells of the covariates, with the component's columns there."""
    made = [m for p in patches if (m := plain_columns(component, p, ranges)) is not None]
    if len(made) < len(patches):
        return None
    cells = [cell_of(component, p, ranges) for p in patches]
    owner = np.concatenate([c[k] for c, k in zip(cells, picks, strict=True)])
    count = int(owner.max(initial=0)) + 1
    number = np.maximum(np.bincount(owner, minlength=count), 1)
    columns = np.stack([
        np.bincount(owner, np.concatenate([
            np.broadcast_to(m[j], p.shape)[k]
            for m, p, k in zip(made, patches, picks, strict=True)
        ]), count) / number
        for j in range(len(made[0]))
    ], axis=1)
    size = np.sqrt((number[:, None] * np.square(columns)).sum() / number.sum())
    return _in_cells(owner, count, edge, columns / size) if size > 0 else None


def _in_cells(
    owner: Owners, count: int, edge: Mask, columns: Floats
) -> RateVariant:
    """Split each cell into what is at edges and what isn't."""
    level = np.repeat(np.array([[1.0, 0.0], [1.0, 1.0]]), count, axis=0)
    return RateVariant(
        owner=owner + count * edge, count=2 * count, level=level,
        columns=np.concatenate([columns, columns]),
    )  # fmt: skip


def _owners(
    each: str, patches: Sequence[Patch], picks: Sequence[Mask]
) -> tuple[Owners, int]:
    out, at = [], 0
    for patch, pick in zip(patches, picks, strict=True):
        n, m = patch.shape
        own = column_groups(m)[None] if each == "column" else at + np.arange(n)[:, None]
        at += n
        out.append(np.broadcast_to(own, (n, m))[pick])
    groups = int(column_groups(patches[0].shape[1])[-1]) + 1
    return np.concatenate(out), groups if each == "column" else at


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RateMember:
    """A cause found in a channel.

    Attributes
    ----------
    change : (N,) of the predictor at the mode, for the readings that take part
    """

    candidate: RateCandidate
    channel: str
    variant: int
    size: float
    nats: float
    shares: Mapping[str, float]
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
    change : (N,) of the predictor at the mode
    """

    factors: Floats
    variant: int
    size: float
    change: Floats


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Weighed:
    nats: float
    variant: int
    size: float
    change: Floats


class RateSearch:
    """Search over causes of one channel, one after the other."""

    def __init__(
        self, channel: Channel, scales: Scales, withheld: frozenset[str] = frozenset()
    ) -> None:
        self.channel, self.scales, self.withheld = channel, scales, withheld

    def factors(
        self, responses: Responses, candidate: RateCandidate
    ) -> tuple[Floats, list[Floats]]:
        """Log Bayes factors (variants, sizes), and the changes at the modes."""
        sizes = SETTINGS.rate_sizes()
        factors, changes = np.zeros((len(candidate.variants), len(sizes))), []
        for i, variant in enumerate(candidate.variants):
            cells = responses.in_cells(variant.owner, variant.count)
            free = self.channel.level_sd
            base = mode(cells, variant.level, free)
            x = np.concatenate([variant.level, variant.columns], axis=1)
            start = np.concatenate([base.coefficients, np.zeros(variant.columns.shape[1])])
            for k, size in enumerate(sizes):
                sd = np.concatenate([free, np.full(variant.columns.shape[1], size)])
                found = mode(cells, x, sd, start)
                factors[i, k] = found.log_evidence - base.log_evidence
                start = found.coefficients
                if candidate.component.relaxed.grows:
                    _, slope, _ = cells.likelihood(variant.level @ base.coefficients)
                    fall = -float(variant.columns[:, -1] @ slope)
                    factors[i, k] = _one_sided(factors[i, k], found, size, fall)
                changes.append(found.coefficients[len(free) :])
        return factors, changes

    def sizes(self, responses: Responses, candidate: RateCandidate) -> Sized:
        """Weigh each size of a candidate against none."""
        factors, changes = self.factors(responses, candidate)
        v, k = (int(i) for i in np.unravel_index(int(np.argmax(factors)), factors.shape))
        variant = candidate.variants[v]
        change = variant.columns @ changes[v * factors.shape[1] + k]
        return Sized(
            factors=np.asarray(logsumexp(factors - np.log(len(factors)), axis=0)), variant=v,
            size=float(SETTINGS.rate_sizes()[k]), change=change[variant.owner],
        )  # fmt: skip

    def weigh(
        self, responses: Responses, candidates: Sequence[RateCandidate]
    ) -> dict[str, _Weighed]:
        """Weigh candidates, each against a good instrument, by name."""
        found: dict[str, _Weighed] = {}
        nothing = 0.0
        for c in candidates:
            one = self.sizes(responses, c)
            quiet = np.log(np.maximum(self.scales.of(c.key), 1e-300))
            nothing = max(nothing, float(logsumexp(one.factors + quiet)))
            found[c.name] = _Weighed(
                nats=float(logsumexp(one.factors + np.log(self.scales.changed(c.key)))),
                variant=one.variant, size=one.size, change=one.change,
            )  # fmt: skip
        best = max(found.values(), key=lambda w: w.nats, default=None)
        if best is None:
            return {}
        # what follows nearly the same curve is as good: no law is exact
        alike = responses.information() * (SETTINGS.doubt_of_rates * best.size) ** 2 / 2
        return {
            n: replace(w, nats=min(w.nats + alike, best.nats) - nothing) for n, w in found.items()
        }

    def search(self) -> list[RateMember]:
        """Find causes until none has odds above one."""
        responses = self.channel.responses
        found: list[RateMember] = []
        for _ in range(SETTINGS.most_causes):
            free = [
                c for c in self.channel.candidates
                if c.name not in {f.candidate.name for f in found}
            ]  # fmt: skip
            free = [c.unclaimed() if c.component.effect in self.withheld else c for c in free]
            weighed = self.weigh(responses, free)
            odds = {c.name: weighed[c.name].nats + SETTINGS.log_odds(c.component.effect)
                    for c in free}  # fmt: skip
            best = max(free, key=lambda c: odds[c.name], default=None)
            if best is None or odds[best.name] <= 0:
                break
            total = logsumexp([0.0, *odds.values()])
            shares = {n: float(np.exp(x - total)) for n, x in odds.items()}
            w = weighed[best.name]
            found.append(RateMember(
                candidate=best, channel=self.channel.name, variant=w.variant, size=w.size,
                nats=w.nats, shares={**shares, "": float(np.exp(-total))}, change=w.change,
            ))  # fmt: skip
            responses = responses.moved(w.change)
        return found
