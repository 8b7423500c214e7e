"""How much laws explain of the noise, losses and outliers by which their causes were found."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_causes import RateMember, RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.settings import SETTINGS


def explained_shares(
    members: Sequence[RateMember], before: Sequence[Channel], after: Sequence[Channel]
) -> dict[tuple[str, str], float]:
    """Weigh the components by which causes were found before their laws and under them.

    A component is a smooth curve, its cause's law is one that falls, or rises, or has its middle
    somewhere: a curve that no such law follows is another cause's. Any law can bring the number of
    readings that are lost; what counts is where.

    Parameters
    ----------
    members : causes as they were found
    before : channels in which they were
    after : of the same readings under the model with the laws

    Returns
    -------
    by channel and effect, the share of what a component gains beyond a level that isn't left
    """
    was, now = ({c.name: c for c in channels} for channels in (before, after))
    shares = {}
    for member in members:
        if member.channel not in now:
            continue
        key, first = member.candidate.key, was[member.channel]
        # the losses that remain form other clumps; they keep the weight they had before
        clumped = now[member.channel].responses.clumped(first.responses.dispersion)
        later = replace(now[member.channel], responses=clumped)
        found, left = (_beyond_level(c, key) for c in (first, later))
        if found >= SETTINGS.stands_out:
            effect = member.candidate.component.effect
            shares[member.channel, effect] = 1.0 - left / found
    return shares


def _beyond_level(channel: Channel, key: str) -> float:
    """By how much a component makes readings more probable than any level, nats."""
    free = replace(channel, level_sd=np.full_like(channel.level_sd, SETTINGS.level_sd_edge))
    search = RateSearch(free, Scales(sizes=SETTINGS.rate_sizes(), weights={}))
    return sum(
        search.sizes(free.responses, c).gain for c in free.candidates if c.key == key
    )  # fmt: skip
