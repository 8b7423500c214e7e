"""Noise, losses and outliers beside what baselines show of them: the change is left.

A baseline's curves are taken out of the recordings'. What they can't tell there stays possible:
with the baseline's posterior covariance C of a component's coefficients, the variance x'Cx of its
curve, averaged over the recordings' readings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.evidence.glm import Responses
from diagnosis.evidence.noise_and_loss_causes import in_turn, likeliest
from diagnosis.evidence.noise_and_loss_channels import Channel, RateCandidate, RateVariant
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]


def beside_baselines(
    channels: Sequence[Channel], usual: Sequence[Channel], scales: Mapping[str, Floats]
) -> tuple[list[Channel], dict[str, Floats]]:
    """Take out of channels what baselines show.

    Parameters
    ----------
    usual : the baselines' channels
    scales : probabilities of each component's sizes in this instrument, by its key

    Returns
    -------
    the channels, and the probabilities beside the baselines
    """
    of = {u.name: u for u in usual}
    known = {
        c.key: _flat(_untold(c, theirs, of[one.name], scales.get(c.key)))
        for one in channels
        if one.name in of
        for c, theirs in _both(one, of[one.name])
    }
    left = [_without(one, of[one.name]) if one.name in of else one for one in channels]
    return left, {**scales, **known}


def _both(channel: Channel, usual: Channel) -> list[tuple[RateCandidate, RateCandidate]]:
    """Candidates of both that have the same columns; what goes with profiles is a recording's."""
    theirs = {c.key: c for c in usual.candidates if c.component.relaxed.each != "profile"}
    return [
        (c, theirs[c.key])
        for c in channel.candidates
        if c.key in theirs
        and len(c.variants) == len(theirs[c.key].variants)
        and _width(c.variants[0]) == _width(theirs[c.key].variants[0])
    ]


def _width(variant: RateVariant) -> int:
    return int(variant.columns.shape[1])


def _without(channel: Channel, usual: Channel) -> Channel:
    """Move the responses by the curves that stand out in the baselines."""
    responses, own = channel.responses, {c.key: c for c, _ in _both(channel, usual)}
    for _, found in in_turn(usual):
        key = likeliest(found)
        if found[key].stands_out and key in own:
            variant = own[key].variants[found[key].variant]
            responses = responses.moved(variant.change(found[key].coefficients))
    return replace(channel, responses=responses)


def _untold(
    candidate: RateCandidate, theirs: RateCandidate, usual: Channel, weights: Floats | None
) -> float:
    """Root of the mean variance of a candidate's curve, given the baselines and a good instrument.

    Parameters
    ----------
    weights : probabilities of the component's sizes, its prior variance's
    """
    sizes = SETTINGS.rate_sizes()
    prior = float(sizes[0] if weights is None else np.sqrt(weights @ np.square(sizes)))
    own, variant = candidate.variants[0], theirs.variants[0]
    covariance = _covariance(variant, usual.responses, usual.level_sd, prior / own.size)
    columns = own.size * own.columns
    variance = (columns @ covariance * columns).sum(axis=1)
    return float(np.sqrt((np.bincount(own.owner, minlength=own.count) @ variance) / own.owner.size))


def _covariance(
    variant: RateVariant, responses: Responses, level_sd: Floats, size: float
) -> Floats:
    """Posterior covariance of coefficients of columns of any size, whatever the level."""
    cells = responses.in_cells(variant.owner, variant.count)
    _, _, curve = cells.likelihood(np.zeros(variant.count))
    columns = np.concatenate([variant.level, variant.size * variant.columns], axis=1)
    deviations = np.concatenate([level_sd, np.full(_width(variant), size)])
    precision = np.diag(deviations**-2.0) + (columns * curve[:, None]).T @ columns
    return np.asarray(np.linalg.inv(precision)[len(level_sd) :, len(level_sd) :])


def _flat(largest: float) -> Floats:
    """Probabilities of sizes any of which may be up to the largest."""
    known = SETTINGS.rate_sizes() <= max(SETTINGS.rate_sizes()[0], largest)
    return np.asarray(known / known.sum())
