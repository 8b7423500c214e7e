"""How much laws explain of the noise, losses and outliers by which their causes were found."""

from collections.abc import Sequence

from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_causes import RateMember, RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.settings import SETTINGS


def explained_shares(
    members: Sequence[RateMember], channels: Sequence[Channel]
) -> dict[tuple[str, str], float]:
    """Weigh again, under the laws, the components by which causes were found.

    A component is a smooth curve, its cause's law is one that falls, or rises, or has its middle
    somewhere: a curve that no such law follows is another cause's.

    Parameters
    ----------
    members : causes as they were found under the model before
    channels : of the same readings under the model with the laws

    Returns
    -------
    by channel and effect, the share of a component's gain that isn't left
    """
    now = {c.name: c for c in channels}
    shares = {}
    for member in members:
        channel = now.get(member.channel)
        if channel is None or member.gain <= 0:
            continue
        search = RateSearch(channel, Scales(sizes=SETTINGS.rate_sizes(), weights={}))
        left = sum(
            search.sizes(channel.responses, c).gain
            for c in channel.candidates if c.key == member.candidate.key
        )  # fmt: skip
        effect = member.candidate.component.effect
        shares[member.channel, effect] = 1.0 - left / member.gain
    return shares
