"""A law explains what its component gains, or little of it."""

from dataclasses import replace
from typing import Literal

import pytest

from diagnosis.evidence.explained_rates import explained_shares
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_causes import RateSearch
from diagnosis.settings import SETTINGS
from tests.support.cell_readings import LINEAR, channel_with

Kind = Literal["scale", "rate"]


EFFECTS: dict[Kind, str] = {"scale": "incidence_noise", "rate": "specular_dropout"}


@pytest.mark.parametrize("kind", EFFECTS)
@pytest.mark.parametrize(("left", "share"), [(0.3, 0.0), (0.15, 0.75), (0.0, 1.0)])
def test_the_share_is_what_of_the_gain_is_not_left(kind: Kind, left: float, share: float) -> None:
    """A gain goes with the square of the change that is left."""
    before, after = (
        channel_with(change, kind, EFFECTS[kind], LINEAR[:, None], seed=1)
        for change in (0.3, left)
    )
    (member,) = RateSearch(before, Scales(sizes=SETTINGS.rate_sizes(), weights={})).search()[0]
    shares = explained_shares([member], [before], [after])
    assert shares == {(before.name, EFFECTS[kind]): pytest.approx(share, abs=0.15)}


def test_what_a_law_leaves_of_clumps_counts_as_they_did() -> None:
    """Most of a shadow's losses are clumps; the few beside it are not, and each told more."""
    before, after = (
        channel_with(change, "rate", EFFECTS["rate"], LINEAR[:, None], seed=1)
        for change in (0.3, 0.15)
    )
    clumps = replace(before, responses=before.responses.clumped(8.0))
    (member,) = RateSearch(clumps, Scales(sizes=SETTINGS.rate_sizes(), weights={})).search()[0]
    (share,) = explained_shares([member], [clumps], [after]).values()
    assert share == pytest.approx(0.75, abs=0.15)


def test_a_channel_that_is_gone_says_nothing() -> None:
    channel = channel_with(0.3, "scale", "incidence_noise", LINEAR[:, None], seed=1)
    members = RateSearch(channel, Scales(sizes=SETTINGS.rate_sizes(), weights={})).search()[0]
    assert explained_shares(members, [channel], []) == {}
