"""Causes of noise and losses: found with their size and sign, or not there."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.noise_and_loss_causes import RateMember, RateSearch
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.settings import SETTINGS
from tests.support.cell_readings import CELLS, LINEAR, U, channel_with, component


def found_in(channel: Channel, withheld: frozenset[str] = frozenset()) -> list[RateMember]:
    scales = Scales(sizes=SETTINGS.rate_sizes(), weights={})
    return RateSearch(channel, scales, withheld).search()[0]


@pytest.mark.parametrize(
    ("kind", "effect"), [("scale", "incidence_noise"), ("rate", "specular_dropout")]
)
@pytest.mark.parametrize("change", [0.3, -0.3])
def test_a_change_along_a_covariate_is_found(kind: str, effect: str, change: float) -> None:
    channel = channel_with(change, kind, effect, LINEAR[:, None], seed=1)
    (member,) = found_in(channel)
    assert member.candidate.component.effect == effect
    assert 0.5 < member.size / abs(change) < 2.0
    assert sum(member.shares.values()) == pytest.approx(1.0)
    owner = channel.candidates[0].variants[0].owner
    unsure = 1 / np.sqrt(channel.responses.information())
    assert member.change == pytest.approx(change * LINEAR[owner], abs=4 * unsure * LINEAR.max())


@pytest.mark.parametrize(
    ("kind", "effect"), [("scale", "incidence_noise"), ("rate", "specular_dropout")]
)
def test_readings_without_a_change_have_no_cause(kind: str, effect: str) -> None:
    found = [found_in(channel_with(0.0, kind, effect, LINEAR[:, None], seed=s)) for s in range(8)]
    assert sum(map(len, found)) <= 1


def test_losses_grow_and_never_shrink() -> None:
    """A good instrument may lose fewer readings than most; that is no cause of anything."""
    ones = np.ones((CELLS, 1))
    more = found_in(channel_with(1.5, "rate", "random_dropout", ones, seed=3))
    assert [m.candidate.component.effect for m in more] == ["random_dropout"]
    assert not found_in(channel_with(-1.5, "rate", "random_dropout", ones, seed=3))


def test_what_is_withheld_is_found_without_a_name() -> None:
    channel = channel_with(0.3, "scale", "incidence_noise", LINEAR[:, None], seed=1)
    (member,) = found_in(channel, frozenset({"incidence_noise"}))
    assert member.candidate.component.effect == ""


def test_nothing_is_nothing_beside_many_readings() -> None:
    """At one per cent of the noise the smallest size still explained most of three per cent."""
    channel = channel_with(0.03, "scale", "incidence_noise", LINEAR[:, None], seed=2, count=40_000)
    (one,) = channel.candidates
    none = Scales(
        sizes=SETTINGS.rate_sizes(), weights={one.key: np.eye(SETTINGS.rate_sizes().size)[0]}
    )
    search = RateSearch(channel, none)
    weighed, _ = search.weigh(channel.responses, [one])
    assert weighed[one.name].nats > 15
    assert [m.candidate for m in search.search()[0]] == [one]


def test_what_a_good_instrument_has_explains_a_curve_that_is_nearly_its_own() -> None:
    """No law is exact: a cause that is a little nearer isn't there for what is usual."""
    bent = LINEAR + 0.1 * (U**2 - np.mean(U**2)) / np.std(U**2)
    channel = channel_with(0.04, "scale", "incidence_noise", LINEAR[:, None], seed=4, count=200_000)
    (usual,) = channel.candidates
    near = replace(usual.variants[0], columns=(bent / np.sqrt(np.mean(bent**2)))[:, None])
    rare = replace(usual, component=component("scale", "light_falloff"))
    usual = replace(usual, variants=(near,))
    none = np.eye(SETTINGS.rate_sizes().size)[0]
    often = np.full(none.size, 1 / none.size)
    for weights, names in ((often, []), (none, ["light_falloff"])):
        known = {usual.key: weights, rare.key: none}
        search = RateSearch(
            replace(channel, candidates=(usual, rare)),
            Scales(sizes=SETTINGS.rate_sizes(), weights=known),
        )
        found = [m.candidate.component.effect for m in search.search()[0]]
        assert bool(found) is bool(names)


def test_a_cause_is_found_beside_what_a_good_instrument_has_more_of() -> None:
    bent = U**2 - np.mean(U**2)
    bent /= np.sqrt(np.mean(bent**2))
    both = (0.3 * LINEAR + 0.1 * bent)[:, None]
    channel = channel_with(1.0, "scale", "incidence_noise", both, seed=4)
    (one,) = channel.candidates
    usual, rare = (
        replace(one, component=component("scale", effect),
                variants=(replace(one.variants[0], columns=column[:, None]),))
        for effect, column in (("incidence_noise", LINEAR), ("light_falloff", bent))
    )  # fmt: skip
    sizes = SETTINGS.rate_sizes()
    often, none = 1.0 * np.isclose(sizes, 0.32), np.eye(sizes.size)[0]
    scales = Scales(sizes=sizes, weights={usual.key: often, rare.key: none})
    found, (habit,) = RateSearch(replace(channel, candidates=(usual, rare)), scales).search()
    assert [m.candidate.component.effect for m in found] == ["light_falloff"]
    assert (habit.name, habit.component) == (usual.name, usual.component)
    assert habit.nats > 100
    assert 0.0 < habit.fault < 1.0


def test_what_explains_nothing_by_itself_is_not_taken_as_given() -> None:
    """All that was as good as the likeliest was taken; nothing was left to hold that against."""
    bent, idle = U**2 - np.mean(U**2), LINEAR
    small = 0.05 * bent[:, None]
    channel = channel_with(1.5, "scale", "incidence_noise", small, seed=7)
    (one,) = channel.candidates
    rare, usual = (
        replace(one, component=component("scale", effect),
                variants=(replace(one.variants[0], columns=columns),))
        for effect, columns in (("light_falloff", small), ("incidence_noise", idle[:, None]))
    )  # fmt: skip
    sizes = SETTINGS.rate_sizes()
    none, often = np.eye(sizes.size)[0], np.full(sizes.size, 1 / sizes.size)
    scales = Scales(sizes=sizes, weights={usual.key: often, rare.key: none})
    alone = replace(channel, candidates=(rare,))
    assert [m.candidate for m in RateSearch(alone, scales).search()[0]] == [rare]
    beside = replace(channel, candidates=(rare, usual))
    assert RateSearch(beside, scales).search() == ([], [])


@pytest.mark.parametrize(("other", "found"), [(-0.3, 1), (-60.0, 0)])
def test_causes_that_share_the_evidence_are_weighed_together(
    other: float, found: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each by itself is less likely than none; two that can't be told apart are likelier."""
    channel = channel_with(0.3, "scale", "incidence_noise", LINEAR[:, None], seed=1)
    (one,) = channel.candidates
    rival = replace(one, component=component("scale", "light_falloff"))
    search = RateSearch(
        replace(channel, candidates=(one, rival)),
        Scales(sizes=SETTINGS.rate_sizes(), weights={}),
    )
    beside_odds, weigh = {one.name: -0.3, rival.name: other}, search.weigh

    def told(*args: Any) -> Any:
        weighed, _ = weigh(*args)
        return {
            n: replace(w, nats=beside_odds[n] - SETTINGS.log_odds(n)) for n, w in weighed.items()
        }, None

    monkeypatch.setattr(search, "weigh", told)
    first = search.search()[0][:1]
    assert len(first) == found
