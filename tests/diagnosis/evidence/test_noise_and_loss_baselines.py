"""Beside baselines: what they show as well is no change."""

import pytest

from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_baselines import beside_baselines
from diagnosis.evidence.noise_and_loss_causes import RateMember, RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.settings import SETTINGS
from tests.support.cell_readings import LINEAR, channel_with

FOLLOWED = [("scale", "incidence_noise"), ("rate", "specular_dropout")]


def channel(change: float, kind: str, effect: str, seed: int) -> Channel:
    return channel_with(change, kind, effect, LINEAR[:, None], seed)


def found_beside(now: Channel, usual: Channel) -> list[RateMember]:
    (left,) = beside_baselines([now], [usual])
    return RateSearch(left, Scales(sizes=SETTINGS.rate_sizes(), weights={})).search()


@pytest.mark.parametrize(("kind", "effect"), FOLLOWED)
def test_what_baselines_have_as_well_is_no_change(kind: str, effect: str) -> None:
    now, usual = channel(0.4, kind, effect, 1), channel(0.4, kind, effect, 2)
    assert RateSearch(now, Scales(sizes=SETTINGS.rate_sizes(), weights={})).search()
    assert not found_beside(now, usual)


@pytest.mark.parametrize(("kind", "effect"), FOLLOWED)
def test_what_has_changed_since_is_found_with_its_size(kind: str, effect: str) -> None:
    (member,) = found_beside(channel(0.9, kind, effect, 1), channel(0.4, kind, effect, 2))
    assert member.candidate.component.effect == effect
    assert 0.5 < member.size / 0.5 < 2.0


def test_a_channel_without_baselines_stays_as_it_is() -> None:
    now = channel(0.4, *FOLLOWED[0], 1)
    (left,) = beside_baselines([now], [])
    assert left is now
