"""What this instrument has of each component when it is good.

Told by the population of good instruments, by the kind that its recordings show it to be of, and by
baselines.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit, logsumexp

from diagnosis.discrepancy.population import (
    ASPECTS,
    Population,
    Shares,
    aspect_of,
    is_law_at_edges,
    tells_kind,
)
from diagnosis.evidence.candidates import Candidate
from diagnosis.evidence.changed_sizes import with_sizes_up_to
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_baselines import beside_baselines
from diagnosis.evidence.noise_and_loss_causes import in_turn
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.posterior import Posterior, Posteriors, Term
from diagnosis.evidence.seen import RATES, Seen, worlds_of
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]


def mean_factors(
    one: Seen, before: Seen | None = None, departures: Mapping[str, Floats] | None = None
) -> dict[str, Floats]:
    """Log Bayes factor of each size of each component, by its key, in recordings of one kind.

    Where the recordings are of a good instrument this is the likelihood of its discrepancy, or of
    what has changed since its baselines. Each component is weighed beside the others at their
    likeliest sizes, so that what several could explain is counted once; what is each recording's
    own comes after what recordings share.

    Parameters
    ----------
    before : baselines
    departures : probability of the sizes of what baselines and recordings share
    """
    sizes = SETTINGS.mean_sizes()
    known = [] if departures is None else one.candidates
    scales = Scales(sizes=sizes, weights=departures or {})
    quiet = scales.deviations(known, len(one.bulk.right))
    worlds = worlds_of(one, before)
    grown: dict[bytes, tuple[Term, float]] = {}

    def factors(c: Candidate, posteriors: Mapping[bool, Posterior]) -> Floats:
        return c.log_factors(posteriors[c.at_edges].cavity(Term(at=c.at)), sizes)[1]

    def posteriors(without: bytes = b"") -> Posteriors:
        return Posteriors(worlds, quiet, [term for at, term in grown.items() if at != without])

    for own in (False, True):
        # the likeliest first: what it explains no other needs to
        waiting = [c for c in one.candidates if c.of_recordings is own and c.shapes[0] is None]
        while waiting:
            now = posteriors()
            found = {c.name: factors(c, now) for c in waiting}
            best = max(waiting, key=lambda c: float(found[c.name].max()))
            if found[best.name].max() < SETTINGS.stands_out:
                break
            grown[best.at.tobytes()] = Term(at=best.at), float(sizes[found[best.name].argmax()])
            waiting = [c for c in waiting if not np.array_equal(c.at, best.at)]
    now = posteriors()
    return {
        c.key: factors(c, posteriors(c.at.tobytes()) if c.at.tobytes() in grown else now)
        for c in one.candidates
    }


def rate_factors(channels: Iterable[Channel]) -> dict[str, Floats]:
    """Return the same of the scale, the losses and the outliers."""
    out: dict[str, Floats] = {}
    for channel in channels:
        for found in in_turn(channel):
            out |= {key: one.factors for key, one in found.items()}
    return out


def change_factors(
    now: Seen,
    before: Seen,
    channels: Mapping[str, Channel],
    usual: Mapping[str, Channel],
    departures: Mapping[str, Floats],
) -> dict[str, Floats]:
    """Return the same of what recordings have beside baselines.

    Parameters
    ----------
    before, usual : the mean and the channels of the baselines
    departures : probability of the sizes of what both share
    """
    left = beside_baselines(list(channels.values()), list(usual.values()))
    return mean_factors(now, before, departures) | rate_factors(left)


def kinds_of(population: Population, factors: Mapping[str, Floats], *, good: bool) -> Shares:
    """Probability of each kind of instruments, given one instrument's recordings, by aspect.

    Before, an instrument is the likelier of a kind the more makes the kind is of.

    Parameters
    ----------
    factors : of components of all channels
    good : whether the instrument was good then; else each component may have changed
    """
    nats = {aspect: np.log(population.makes) for aspect in ASPECTS}
    changes = 0.0 if good else SETTINGS.prior_cause
    for name, likelihood in factors.items():
        weights = population.weights(name)
        if weights is None or not tells_kind(name):
            continue
        for k, own in enumerate(weights):
            changed = Scales(sizes=_sizes(name), weights={name: own}).changed(name)
            mixed = (1 - changes) * own + changes * changed
            nats[aspect_of(name)][k] += evidence(mixed, likelihood)
    return {aspect: np.exp(own - logsumexp(own)) for aspect, own in nats.items()}


def informed(
    population: Population, kinds: Shares, factors: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Probability of each component's sizes in an instrument, given its baselines.

    Parameters
    ----------
    kinds : probability of each kind of instruments
    factors : log Bayes factor of each size of each component, of the baselines
    """
    out = population.of_kinds(kinds)
    for name, likelihood in factors.items():
        own = told(_of_each_kind(population, name), likelihood)
        out[name] = population.having(name, kinds) @ own
    return out


def told(weights: Floats, likelihood: Floats) -> Floats:
    """Probability (..., S) of each size given its likelihood (S,), by log factors."""
    log = np.log(np.maximum(weights, 1e-300)) + likelihood
    return np.asarray(np.exp(log - evidence(weights, likelihood)[..., None]))


def evidence(weights: Floats, likelihood: Floats) -> Floats:
    """Log probability (...) of what was seen, by the sizes' probabilities (..., S)."""
    return np.asarray(logsumexp(np.log(np.maximum(weights, 1e-300)) + likelihood, axis=-1))


def told_by_changes(
    population: Population,
    kinds: Shares,
    factors: Mapping[str, Floats],
    among: Mapping[str, Floats],
) -> dict[str, Floats]:
    """Probability of the sizes of an instrument's next change, by component, given its baselines.

    See `next_changes`; how often the next is as those before, the population tells.
    """
    out = {}
    for name, (usual, alike) in next_changes(population, kinds, factors, among).items():
        share = population.alike.get(aspect_of(name), 0.5)
        out[name] = (1 - share) * usual + share * alike
    return out


def next_changes(
    population: Population,
    kinds: Shares,
    factors: Mapping[str, Floats],
    among: Mapping[str, Floats],
) -> dict[str, tuple[Floats, Floats]]:
    """Probability (S,) of the sizes of an instrument's next change, by component, in two ways.

    As kinds tell, and as its own before: two recordings may show another part of the field than the
    next two.

    Parameters
    ----------
    factors : log Bayes factor of each size of each component, of the baselines. What a law at edges
        does there depends on their edges: it tells how unlike the instrument is, and no size
    among : the same of what later baselines have beside the first
    """
    changes, out = population.of_changes, {}
    for name in {n: None for k in changes.kinds for n in k.weights} | dict.fromkeys(among):
        usual = _usual_change(population, name, factors.get(name))
        if usual is None:
            continue
        shares = changes.having(name, kinds)
        alike = told(usual, among[name]) if name in among else usual
        out[name] = shares @ usual, shares @ alike
    return out


def _usual_change(
    population: Population, name: str, likelihood: Floats | None
) -> Floats | None:
    """Probability (kinds, S) of a change's size; None where no kind has its like.

    An instrument that is unlike in what it departs by is so in what it changes by.
    """
    changes = population.of_changes.apart(name)
    if changes is None:
        return None
    known, unseen = population.apart(name) or (_small(name)[None], _small(name))
    likelihood = np.zeros(len(unseen)) if likelihood is None else likelihood
    odds = logit(population.unlike(name)) + evidence(unseen, likelihood)
    unlike = expit(odds - evidence(known, likelihood))[:, None]
    if is_law_at_edges(name):
        likelihood = np.zeros_like(likelihood)
    anew = population.anew(name)
    alike = _next(told(known, likelihood), changes[0], anew[0][:, None])
    other = _next(told(unseen, likelihood), changes[1], anew[1])
    return np.asarray((1 - unlike) * alike + unlike * other)


def _next(own: Floats, changes: Floats, anew: Floats | float) -> Floats:
    """Probability (..., S) of a change's size by one kind, given those of its baselines.

    What comes anew is as large as what there was: two departures of one size differ by √2 of it,
    which is half a step of the grid.
    """
    return np.asarray((1 - anew) * changes + anew * own)


def _of_each_kind(population: Population, name: str) -> Floats:
    """Probability (kinds, S) of a component's sizes; small ones where no kind has its like."""
    weights = population.weights(name)
    if weights is None:
        return np.tile(_small(name), (len(population.kinds), 1))
    return weights


def _small(name: str) -> Floats:
    """Probability (S,) of the sizes of a component of which nothing is known."""
    return Scales(sizes=_sizes(name), weights={}).of(name)


def nats_of_size(population: Population, name: str, size: float) -> float:
    """Log Bayes factor of a cause whose whitened rms is known, against a good instrument's."""
    scales = of_any_kind(population, name)
    k = int(np.abs(np.log(scales.sizes / max(size, scales.sizes[0]))).argmin())
    good, changed = (np.maximum(w[k], 1e-300) for w in (scales.of(name), scales.changed(name)))
    return float(np.log(changed / good))


def of_any_kind(population: Population, name: str) -> Scales:
    """Sizes that good instruments have of one component, whatever their kind.

    A kind is as probable as it is of many makes.
    """
    weights = population.weights(name)
    shares = population.makes / population.makes.sum()
    return Scales(
        sizes=SETTINGS.mean_sizes(), weights={} if weights is None else {name: shares @ weights}
    )


def alike_at_edges(
    usual: Mapping[str, Floats], factors: Mapping[str, Floats], candidates: Sequence[Candidate]
) -> dict[str, Floats]:
    """Let laws of light at edges have a share of what baselines show of all of them together.

    At the few points of their grids these laws are alike, and none is exactly nature's: how what an
    instrument does at edges is shared out among them is another from one recording to the next.

    Parameters
    ----------
    usual : probability of each component's sizes in a good instrument
    factors : of the mean in the baselines
    """
    out, sizes = dict(usual), SETTINGS.mean_sizes()
    keys = [c.key for c in candidates if c.at_edges and c.key in factors]
    plain = [factors[k] for k in keys if factors[k].max() >= SETTINGS.stands_out]
    shown = [sizes[int(one.argmax())] for one in plain]
    most = SETTINGS.doubt_at_edges * float(np.linalg.norm(shown))
    return out | {key: with_sizes_up_to(most, out[key], sizes) for key in keys}


def rate_of(component: str) -> str:
    """Name the channel of a component's noise, losses or outliers; "" of all else."""
    channel = component.partition(": ")[0]
    return channel if channel in RATES else ""


def _sizes(component: str) -> Floats:
    """Grid of a component's sizes."""
    return SETTINGS.rate_sizes() if rate_of(component) else SETTINGS.mean_sizes()
