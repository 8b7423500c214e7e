"""Beside baselines: what they show as well is no change."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence.glm import Events
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_baselines import beside_baselines
from diagnosis.evidence.noise_and_loss_causes import RateMember, RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel, level_sd_of
from diagnosis.settings import SETTINGS
from tests.support.cell_readings import LINEAR, U, channel_with

FOLLOWED = [("scale", "incidence_noise"), ("rate", "specular_dropout")]


def channel(change: float, kind: str, effect: str, seed: int) -> Channel:
    return channel_with(change, kind, effect, LINEAR[:, None], seed)


def found_beside(now: Channel, usual: Channel) -> list[RateMember]:
    (left,) = beside_baselines([now], [usual])
    return RateSearch(left, Scales(sizes=SETTINGS.rate_sizes(), weights={})).search()[0]


@pytest.mark.parametrize(("kind", "effect"), FOLLOWED)
def test_what_baselines_have_as_well_is_no_change(kind: str, effect: str) -> None:
    now, usual = channel(0.4, kind, effect, 1), channel(0.4, kind, effect, 2)
    assert RateSearch(now, Scales(sizes=SETTINGS.rate_sizes(), weights={})).search()[0]
    assert not found_beside(now, usual)


@pytest.mark.parametrize(("kind", "effect"), FOLLOWED)
def test_what_has_changed_since_is_found_with_its_size(kind: str, effect: str) -> None:
    (member,) = found_beside(channel(0.9, kind, effect, 1), channel(0.4, kind, effect, 2))
    assert member.candidate.component.effect == effect
    assert 0.5 < member.size / 0.5 < 2.0


@pytest.mark.parametrize(("kind", "effect"), FOLLOWED)
def test_where_baselines_did_not_look_they_promise_nothing(kind: str, effect: str) -> None:
    """The baselines' curve rises as far as they reach; farther out the recordings' is flat."""
    flat = np.minimum(LINEAR, LINEAR[U < 0].max())
    curves = np.stack([LINEAR, LINEAR - flat], axis=1)
    now = with_columns(channel_with(0.9, kind, effect, flat[:, None], 1), curves)
    usual = with_columns(channel(0.9, kind, effect, 2), curves)
    usual = within(usual, U[usual.candidates[0].variants[0].owner] < 0)
    assert not found_beside(now, usual)
    # where baselines looked, what has changed is found as before
    assert found_beside(with_columns(channel(1.8, kind, effect, 3), curves), usual)


def within(one: Channel, reached: np.ndarray) -> Channel:
    """Take the readings that were reached."""
    responses, (candidate,) = one.responses, one.candidates
    of_readings = ("seen", "usual" if isinstance(responses, Events) else "number")
    taken = {f: getattr(responses, f)[reached] for f in of_readings}
    (variant,) = candidate.variants
    variants = (replace(variant, owner=variant.owner[reached]),)
    return replace(
        one, responses=replace(responses, **taken),
        candidates=(replace(candidate, variants=variants),),
    )  # fmt: skip


def with_columns(one: Channel, columns: np.ndarray) -> Channel:
    """Let a channel's candidate have other columns."""
    (candidate,) = one.candidates
    (variant,) = candidate.variants
    variants = (replace(variant, columns=columns),)
    return replace(one, candidates=(replace(candidate, variants=variants),))


COUNT = 100_000
"""Readings of a baseline or a recording, of which few are lost."""


def losses(share: float, seed: int, noise: float) -> Channel:
    """Losses anywhere, of which a share passes for noise."""
    one = channel_with(0.0, "rate", "random_dropout", np.ones((8, 1)), seed, count=COUNT)
    seen = (np.random.default_rng(seed).random(COUNT) < share).astype(float)
    responses = Events(seen=seen, usual=np.full(COUNT, noise), noise=noise)
    return replace(one, responses=responses, level_sd=level_sd_of(responses))


def test_no_more_losses_pass_for_noise_than_baselines_have() -> None:
    """Fifty in 100,000 pass for noise, but not where baselines have none."""
    now, without = losses(5e-4, 1, 5e-4), losses(0.0, 2, 0.5 / COUNT)
    sizes, key = SETTINGS.rate_sizes(), now.candidates[0].key
    steady = Scales(sizes=sizes, weights={key: np.eye(len(sizes))[0]})
    assert not RateSearch(now, steady).search()[0]
    for usual, found in ((without, True), (losses(5e-4, 3, 5e-4), False)):
        (left,) = beside_baselines([now], [usual])
        assert bool(RateSearch(left, steady).search()[0]) == found


def test_a_level_is_known_as_well_as_baselines_tell_it() -> None:
    """The root of a Poisson count over N readings is known to 1 / (2 √N) of one."""
    now, usual = losses(5e-4, 1, 5e-4), losses(0.0, 2, 0.5 / COUNT)
    (left,) = beside_baselines([now], [usual])
    own = SETTINGS.level_sd_off * np.sqrt(0.5 / COUNT)
    off = np.hypot(own, COUNT**-0.5)
    assert left.level_sd == pytest.approx([off, SETTINGS.level_sd_edge])


def test_fewer_than_baselines_have_are_no_change() -> None:
    now, usual = losses(1e-4, 1, 1e-4), losses(5e-4, 2, 5e-4)
    (left,) = beside_baselines([now], [usual])
    assert isinstance(left.responses, Events)
    assert left.responses.usual == pytest.approx(1e-4)


def test_what_a_law_says_of_losses_stays() -> None:
    now, usual = losses(5e-4, 1, 5e-4), losses(0.0, 2, 0.5 / COUNT)
    shadow = np.where(np.arange(COUNT) < 100, 0.9, 5e-4)
    now = replace(now, responses=replace(now.responses, usual=shadow))
    (left,) = beside_baselines([now], [usual])
    assert isinstance(left.responses, Events)
    assert (left.responses.usual[:100] == 0.9).all()
    assert left.responses.usual[100:] == pytest.approx(0.5 / COUNT)


def test_a_channel_without_baselines_stays_as_it_is() -> None:
    now = channel(0.4, *FOLLOWED[0], 1)
    (left,) = beside_baselines([now], [])
    assert left is now
