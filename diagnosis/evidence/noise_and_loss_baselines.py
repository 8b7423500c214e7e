"""Noise, losses and outliers beside what baselines show of them: the change is left."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.evidence.noise_and_loss_causes import in_turn, likeliest
from diagnosis.evidence.noise_and_loss_channels import (
    Channel,
    RateCandidate,
    RateVariant,
    level_sd_of,
)


def beside_baselines(channels: Sequence[Channel], usual: Sequence[Channel]) -> list[Channel]:
    """Take the curves that stand out in baselines out of the recordings' channels.

    Parameters
    ----------
    usual : the baselines' channels
    """
    of = {u.name: u for u in usual}
    return [_without(one, of[one.name]) if one.name in of else one for one in channels]


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
    """Move the responses by the curves that stand out in the baselines.

    What passes for noise is known as well as the baselines tell it. Where recordings reach farther
    than baselines, these leave a curve open (`Channel.doubts`).
    """
    own = {c.key: c for c, _ in _both(channel, usual)}
    responses, doubts = channel.responses.beside(usual.responses), []
    unsure = usual.responses.information() ** -0.5
    level_sd = np.hypot(level_sd_of(responses), [unsure, 0.0])
    for found in in_turn(usual):
        key = likeliest(found)
        if found[key].stands_out and key in own:
            variant = own[key].variants[found[key].variant]
            responses = responses.moved(variant.change(found[key].coefficients))
            columns = variant.size * variant.columns @ found[key].root
            doubts.append(replace(variant, columns=columns, size=1.0))
    return replace(channel, responses=responses, level_sd=level_sd, doubts=tuple(doubts))
