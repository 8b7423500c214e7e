"""Learn what good instruments have of each component, and what changes in them.

Of each kind of instruments it needs, for each instrument, the likelihood of each size of each
component: of what it departs from the nominal model by, and of what later recordings have beside
its first.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from diagnosis.discrepancy.good_instrument import evidence, rate_of, told
from diagnosis.discrepancy.population import aspect_of

Floats = NDArray[np.float64]
SPREADS = (0.35, 0.5, 0.7, 1.0)
"""Standard deviations of the logarithm of the size among good instruments that are weighed."""
SPREADS_OF_RATES = (*SPREADS, 1.4, 2.0)
"""The same of what noise, losses and outliers go with: how these grow on slopes differs between
good instruments by more than tenfold. Wider ones of the mean would let one component's rare
departure stand for any other's, since the likeliest of all stands for a good instrument."""
NONE = (0.0, 0.25, 0.5, 0.75)
"""Shares of good instruments that have nothing of a component, which are weighed: they have the
smallest size."""
ANEW = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Shares of changes that come anew, which are weighed."""
ALIKE = np.linspace(0.0, 1.0, 21)
"""Shares of instruments whose next change is as those before, which are weighed."""
APART = np.linspace(0.0, 3.0, 7)
"""Doublings by which sizes lie further apart in a kind that was never seen, which are weighed."""
TURNS = 300
"""Steps to the likeliest shares of the spreads; each makes them likelier."""


def learnt(kinds: Sequence[Sequence[Mapping[str, Floats]]]) -> list[dict[str, Floats]]:
    """Probability of each size of each component, by kinds of instruments.

    Of the instruments of a kind a share has nothing of a component, in the others its size is
    lognormal: were those with nothing the low end of one distribution, its other end would be as
    long, and no fault of ten times what any good instrument has would stand out. Share, median and
    spread are averaged over their posterior. Before any instrument a median is the less probable
    the larger it is, as its inverse: what no recording of the population could show isn't taken for
    usual. How probable shares and spreads are before, components of a kind tell together, those of
    each channel by themselves (empirical Bayes; Efron & Morris, J. Am. Stat. Assoc. 68 (1973) 117):
    most are alike in all instruments, and in a few these differ widely.

    Parameters
    ----------
    kinds : of each kind, each instrument's log factors of sizes, by component
    """
    return [one for kind in kinds for one in _learnt_together([kind])]


def _learnt_together(
    kinds: Sequence[Sequence[Mapping[str, Floats]]], anew: Sequence[float] = ()
) -> list[dict[str, Floats]]:
    """Learn sizes of kinds that tell together how probable shares and spreads are before.

    Parameters
    ----------
    anew : shares of the last that are weighed, where it is no size but an event apart
    """
    found: dict[tuple[int, str], list[Floats]] = {}
    for kind, instruments in enumerate(kinds):
        for factors in instruments:
            for name, own in factors.items():
                found.setdefault((kind, name), []).append(own)
    weights: dict[tuple[int, str], Floats] = {}
    for channel in dict.fromkeys(rate_of(name) for _, name in found):
        alike = {key: f for key, f in found.items() if rate_of(key[1]) == channel}
        weights |= _together(alike, SPREADS_OF_RATES if channel else SPREADS, anew)
    return [
        {name: weights[k, name] for k, name in found if k == kind} for kind in range(len(kinds))
    ]


def _together(
    found: Mapping[tuple[int, str], Sequence[Floats]],
    spreads: Sequence[float],
    anew: Sequence[float],
) -> dict[tuple[int, str], Floats]:
    """Probability of each size of components whose shares and spreads are told together.

    By kind and name.
    """
    fits = {key: _fits(np.stack(own), spreads, anew) for key, own in sorted(found.items())}
    shares = _shares(np.stack([logsumexp(nats, axis=1) for nats, _ in fits.values()]))
    return {key: _mixed(*fit, shares) for key, fit in fits.items()}


def _shares(nats: Floats) -> Floats:
    """Likeliest probability of each form (forms,), from log evidence (components, forms)."""
    out = np.full(nats.shape[1], 1.0 / nats.shape[1])
    for _ in range(TURNS):
        each = nats + np.log(np.maximum(out, 1e-300))
        out = np.exp(each - logsumexp(each, axis=1, keepdims=True)).mean(axis=0)
    return np.asarray(out)


def _mixed(nats: Floats, weights: Floats, shares: Floats) -> Floats:
    """Probability of each size (sizes,), over all forms and medians."""
    posterior = nats + np.log(np.maximum(shares, 1e-300))[:, None]
    return np.asarray(np.einsum("fm,fmk->k", np.exp(posterior - logsumexp(posterior)), weights))


def _fits(
    log: Floats, spreads: Sequence[float], anew: Sequence[float]
) -> tuple[Floats, Floats]:
    """Log evidence (forms, medians) and sizes (forms, medians, sizes) of lognormal ones.

    A form has a spread, a share of instruments that have nothing, and one of what comes anew.

    Parameters
    ----------
    log : (instruments, sizes) log factors of each instrument
    """
    steps = np.arange(log.shape[1] - bool(anew), dtype=np.float64)
    middles = np.arange(-2.0, steps.size, 0.5)
    nats, weights = [], []
    for spread in spreads:
        some = np.exp(-0.5 * np.square((steps - middles[:, None]) * np.log(2.0) / spread))
        some = np.maximum(some / np.maximum(some.sum(axis=1, keepdims=True), 1e-300), 1e-300)
        some /= some.sum(axis=1, keepdims=True)
        for none in NONE:
            usual = (1.0 - none) * some
            usual[:, 0] += none
            for w in [_with_last(usual, share) for share in anew] or [usual]:
                each = logsumexp(log[None] + np.log(np.maximum(w, 1e-300))[:, None], axis=2)
                nats.append(each.sum(axis=1) - np.log(2.0) * middles)
                weights.append(w)
    return np.stack(nats), np.stack(weights)


def _with_last(weights: Floats, share: float) -> Floats:
    """Append a last event (medians, 1) of this share to weights (medians, sizes)."""
    return np.column_stack([(1.0 - share) * weights, np.full(len(weights), share)])


def factors_of_change(departures: Floats, shown: Floats, change: Floats) -> Floats:
    """Log factors (S + 1,) of a change: of its sizes, and last of one that comes anew.

    Parameters
    ----------
    departures : probability (S,) of the component's sizes among the kind's instruments
    shown, change : log factors (S,) of the sizes in the first recording, and of what others change
    """
    return np.append(change, evidence(told(departures, shown), change))


def learnt_changes(
    kinds: Sequence[Sequence[Mapping[str, Floats]]],
) -> list[tuple[dict[str, Floats], dict[str, float]]]:
    """Probability of the sizes of each kind's changes, by component, and how often they come anew.

    Where a kind departs by nothing, its recordings leave open how often that comes anew: other
    kinds tell.

    Parameters
    ----------
    kinds : of each kind, each instrument's `factors_of_change` by component
    """
    return [
        ({n: w[:-1] / w[:-1].sum() for n, w in one.items()},
         {n: float(w[-1]) for n, w in one.items()})
        for one in _learnt_together(kinds, ANEW)
    ]  # fmt: skip


def factors_alike(usual: Floats, alike: Floats, change: Floats) -> Floats:
    """Log evidence (A,) of each share of instruments whose next change is as those before.

    Parameters
    ----------
    usual, alike : probability (S,) of the next change's sizes in both cases
    change : log factors (S,) of the next change
    """
    return evidence(usual + ALIKE[:, None] * (alike - usual), change)


def learnt_alike(instruments: Sequence[Mapping[str, Floats]]) -> dict[str, float]:
    """Mean of the share's posterior, by aspect.

    Parameters
    ----------
    instruments : of each, `factors_alike` by component
    """
    return _means(((aspect_of(n), own) for one in instruments for n, own in one.items()), ALIKE)


def learnt_apart(told: Mapping[tuple[str, str], Floats]) -> dict[str, float]:
    """Mean of the posterior of how far sizes lie apart in a kind that was never seen, by aspect.

    Parameters
    ----------
    told : log evidence (A,) of each of `APART`, by a population that the others tell, and by aspect
    """
    return _means(((aspect, own) for (_, aspect), own in told.items()), APART)


def _means(told: Iterable[tuple[str, Floats]], values: Floats) -> dict[str, float]:
    """Posterior mean of a number by aspect, from log evidence (A,) of its values (A,), summed."""
    nats: dict[str, Floats] = {}
    for aspect, own in told:
        nats[aspect] = nats.get(aspect, np.zeros(values.size)) + own
    return {a: float(np.exp(own - logsumexp(own)) @ values) for a, own in sorted(nats.items())}
