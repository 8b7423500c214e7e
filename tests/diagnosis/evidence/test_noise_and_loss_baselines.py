"""Beside baselines: what they show as well is no change."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence.glm import Events
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_baselines import beside_baselines
from diagnosis.evidence.noise_and_loss_causes import RateMember, RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel
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


def test_a_channel_without_baselines_stays_as_it_is() -> None:
    now = channel(0.4, *FOLLOWED[0], 1)
    (left,) = beside_baselines([now], [])
    assert left is now
