"""What the readings need beyond a model, in all channels: causes with their probabilities."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from diagnosis.components.component import Component, components_of, ranges_of, with_pitches
from diagnosis.evidence.candidates import Candidate, candidates_of
from diagnosis.evidence.causes import CauseSearch, Member, Scales, World
from diagnosis.evidence.gram import Gram, Turns, grams_of, shared_only, turned, turns_of
from diagnosis.evidence.posterior import Posterior, Term
from diagnosis.evidence.rates import Channel, RateMember, RateSearch, channel_of
from diagnosis.noise import NoiseModel
from diagnosis.patch import Patch
from diagnosis.settings import SETTINGS
from diagnosis.workspace import Model, Workspace

Floats = NDArray[np.float64]
RATES = ("scale", "missing", "outliers")
COVARIATES = ("x", "depth", "travel", "slope_y", "incidence", "half_vector", "clock",
              "part_x", "part_y", "part_z")  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Assessment:
    """Causes found in each channel.

    Attributes
    ----------
    mean : members of the mean's set
    rates : members of the other channels
    effects : by channel, the effect of each candidate ("" of unknown ones)
    """

    mean: tuple[Member, ...]
    rates: tuple[RateMember, ...]
    effects: Mapping[str, Mapping[str, str]]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Seen:
    """Recordings under a model, as equations and channels.

    Attributes
    ----------
    bulk, whole : normal equations of the mean's components, off edges and over all readings
    turns : how their columns were combined
    candidates : of the mean
    channels : scale, missing and outliers, where there is something to see
    """

    bulk: Gram
    whole: Gram
    turns: Turns
    candidates: tuple[Candidate, ...]
    channels: tuple[Channel, ...]
    components: tuple[Component, ...]
    ranges: Mapping[str, tuple[float, float]]


def seen(
    patches: Sequence[Patch],
    noise: NoiseModel,
    model: Model,
    *,
    like: Seen | None = None,
) -> Seen:
    """Look at recordings under a model.

    Parameters
    ----------
    like : recordings whose components are taken, for baselines of the same instrument
    """
    ws = Workspace.build(patches, noise)
    laws = ws.predict(model)
    states = ws.states(laws)
    ranges = ranges_of(patches, COVARIATES) if like is None else like.ranges
    if like is None:
        components = with_pitches(components_of("mean"), patches, states)
    else:
        components = like.components
    bulk, whole = grams_of(components, patches, states, ranges, noise)
    turns = turns_of(bulk, whole) if like is None else like.turns
    bulk, whole = turned(bulk, turns), turned(whole, turns)
    times: dict[int, list[Floats]] = {}
    ways: dict[int, list[Floats]] = {}
    for p in patches:
        times.setdefault(p.recording, []).append(p.view.time_s)
        ways.setdefault(p.recording, []).append(p.view.travel_mm)
    candidates = candidates_of(
        bulk, {k: np.concatenate(v) for k, v in times.items()},
        {k: np.concatenate(v) for k, v in ways.items()}, patches[0].view.sensor.effects,
    )  # fmt: skip
    made = (channel_of(n, patches, laws, states, ranges, noise) for n in RATES)
    return Seen(
        bulk=bulk, whole=whole, turns=turns, candidates=tuple(candidates),
        channels=tuple(c for c in made if c is not None),
        components=tuple(c for c in components if c.name in turns), ranges=ranges,
    )  # fmt: skip


def good_factors(one: Seen) -> dict[str, Floats]:
    """Log Bayes factor of each size of each component, by its key, in recordings of one kind.

    Where the recordings are of a good instrument this is the likelihood of its discrepancy. Each
    component is weighed beside the others at their likeliest sizes, so that what several could
    explain is counted once; what is each recording's own comes after what recordings share.
    """
    out = _mean_factors(one)
    for channel in one.channels:
        search = RateSearch(channel, Scales(sizes=SETTINGS.rate_sizes(), weights={}))
        responses, waiting = channel.responses, list(channel.candidates)
        while waiting:
            found = {c.key: search.sizes(responses, c) for c in waiting}
            best = max(waiting, key=lambda c: float(found[c.key].factors.max()))
            out |= {key: w.factors for key, w in found.items()}
            if out[best.key].max() < 1.0:
                break
            responses = responses.moved(found[best.key].change)
            waiting.remove(best)
    return out


def _mean_factors(one: Seen) -> dict[str, Floats]:
    sizes = SETTINGS.mean_sizes()
    quiet = np.full(len(one.bulk.right), sizes[0])

    def factors(c: Candidate, posteriors: Mapping[bool, Posterior]) -> Floats:
        each = c.log_factors(posteriors[c.at_edges].cavity(Term(at=c.at)), sizes)
        return np.asarray(logsumexp(each - np.log(len(each)), axis=0))

    def posteriors() -> dict[bool, Posterior]:
        return {
            edges: Posterior(g.equations, quiet)
            for edges, g in ((False, one.bulk), (True, one.whole))
        }

    for own in (False, True):
        # the likeliest first: what it explains no other needs to
        waiting = [c for c in one.candidates if c.of_recordings is own and c.shapes[0] is None]
        while waiting:
            now = posteriors()
            found = {c.name: factors(c, now) for c in waiting}
            best = max(waiting, key=lambda c: float(found[c.name].max()))
            if found[best.name].max() < 1.0:
                break
            quiet[best.at] = sizes[int(found[best.name].argmax())]
            waiting = [c for c in waiting if not np.array_equal(c.at, best.at)]
    out = {}
    now = posteriors()
    for c in one.candidates:
        if (quiet[c.at] > sizes[0]).any():
            kept, quiet[c.at] = quiet[c.at].copy(), sizes[0]
            out[c.key] = factors(c, posteriors())
            quiet[c.at] = kept
        else:
            out[c.key] = factors(c, now)
    return out


def informed(scales: Mapping[str, Floats], factors: Mapping[str, Floats]) -> dict[str, Floats]:
    """Weights of each component's size given recordings of the same good instrument."""
    out = dict(scales)
    for name, likelihood in factors.items():
        rate = ": " in name
        flat = Scales(
            sizes=SETTINGS.rate_sizes() if rate else SETTINGS.mean_sizes(), weights=scales
        )
        log = np.log(np.maximum(flat.of(name), 1e-300)) + likelihood
        out[name] = np.exp(log - logsumexp(log))
    return out


def assessed(
    found: Seen,
    scales: Mapping[str, Floats],
    baseline: Seen | None = None,
    *,
    withheld: frozenset[str] = frozenset(),
    channels: Sequence[str] = ("mean", *RATES),
    explained: float = 0.0,
) -> Assessment:
    """Weigh all causes.

    Parameters
    ----------
    scales : weights of each component's size in a good instrument
    baseline : recordings of the same instrument when it was good
    withheld : effects that must not be named: what follows their covariates has no name then
    explained : whitened rms of what the model explains already
    """
    mean: list[Member] = []
    if "mean" in channels:
        worlds = [
            World(
                found=now.equations, baseline=None if before is None else shared_only(before, now)
            )
            for now, before in (
                (found.bulk, None if baseline is None else baseline.bulk),
                (found.whole, None if baseline is None else baseline.whole),
            )
        ]
        search = CauseSearch(
            worlds[0], worlds[1],
            [c.unclaimed() if c.effect in withheld else c for c in found.candidates],
            Scales(sizes=SETTINGS.mean_sizes(), weights=scales), explained=explained,
        )  # fmt: skip
        mean = search.search()
    rates: list[RateMember] = []
    for channel in found.channels:
        if channel.name in channels:
            rates += RateSearch(
                channel, Scales(sizes=SETTINGS.rate_sizes(), weights=scales), withheld
            ).search()
    effects: dict[str, dict[str, str]] = {"mean": {c.name: c.effect for c in found.candidates}}
    for channel in found.channels:
        effects[channel.name] = {c.name: c.component.effect for c in channel.candidates}
    effects = {
        name: {k: "" if e in withheld else e for k, e in known.items()}
        for name, known in effects.items()
    }
    return Assessment(mean=tuple(mean), rates=tuple(rates), effects=effects)
