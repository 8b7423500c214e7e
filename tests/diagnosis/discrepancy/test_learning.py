"""What is learnt of good instruments' discrepancy and of what changes in them."""

import numpy as np
import pytest

from diagnosis.discrepancy.good_instrument import told
from diagnosis.discrepancy.learning import (
    factors_alike,
    factors_of_change,
    learnt,
    learnt_alike,
    learnt_changes,
)
from diagnosis.evidence.changed_sizes import changed, usual
from tests.support.seen_sizes import SIZES, seen_as


def test_sizes_are_those_that_the_instruments_show() -> None:
    rng = np.random.default_rng(0)
    sizes = 0.03 * np.exp(0.5 * rng.standard_normal(40))
    weights = learnt([[{"bow": seen_as(float(s))} for s in sizes]])[0]["bow"]
    assert weights.sum() == pytest.approx(1.0)
    typical = SIZES[np.searchsorted(np.cumsum(weights), 0.5)]
    assert 0.015 < typical < 0.06
    assert weights[SIZES > 0.5].sum() < 1e-3


def test_spreads_are_those_that_components_have_together() -> None:
    """Of thirty components alike in all instruments and one that differs widely, that one does."""
    rng = np.random.default_rng(1)
    alike = {f"scale: c{k}": [seen_as(0.03 * 1.01 ** rng.standard_normal()) for _ in range(20)]
             for k in range(30)}  # fmt: skip
    wide = [seen_as(float(s)) for s in 0.01 * np.exp(2.0 * rng.standard_normal(20))]
    every = {**alike, "scale: wide": wide, "wide": wide}
    (weights,) = learnt([[{n: own[k] for n, own in every.items()} for k in range(20)]])
    assert weights["scale: wide"][SIZES > 0.1].sum() > 0.05
    assert weights["scale: c0"][SIZES > 0.1].sum() < 0.01
    # what the noise goes with may differ by more than what the mean does
    assert weights["wide"][SIZES > 1.0].sum() < weights["scale: wide"][SIZES > 1.0].sum()


def test_good_instruments_without_a_departure_have_none() -> None:
    weights = learnt([[{"bow": seen_as(1e-5)}] * 30])[0]["bow"]
    assert weights[SIZES > 0.05].sum() < 0.01


def test_instruments_with_nothing_make_no_large_size_usual() -> None:
    """Half have nothing, the others a twentieth: ten times that is no good instrument's."""
    rng = np.random.default_rng(3)
    some = [seen_as(0.05 * float(np.exp(0.3 * e)), 40) for e in rng.standard_normal(20)]
    none = [seen_as(1e-5, 40)] * 20
    mixed, alone = (learnt([[{"bow": one} for one in many]])[0]["bow"]
                    for many in (some + none, some))  # fmt: skip
    assert mixed[0] == pytest.approx(0.5, abs=0.15)
    large = SIZES >= 0.4
    assert mixed[large].sum() < 1e-4
    # those with some are distributed as if there were no others
    with_any = mixed[1:] / mixed[1:].sum()
    assert with_any == pytest.approx(alone[1:] / alone[1:].sum(), abs=0.05)
    # and a change is larger than what most of these have
    assert SIZES[usual(mixed)] == pytest.approx(0.05, rel=0.5)
    assert changed(mixed)[SIZES < 0.05].sum() < 1e-6


@pytest.mark.parametrize("of_departures", [False, True])
def test_it_is_learnt_whether_changes_come_anew(of_departures: bool) -> None:
    """In half of the instruments a change is as large as what there was, or always small."""
    rng = np.random.default_rng(4)
    had = 0.1 * np.exp(0.7 * rng.standard_normal(60))
    change = np.full(60, 0.004)
    if of_departures:
        change[::2] = had[::2]
    shown = [seen_as(float(s), 40) for s in had]
    (departures,) = learnt([[{"bow": one} for one in shown]])
    ((changes, anew),) = learnt_changes([[
        {"bow": factors_of_change(departures["bow"], one, seen_as(float(c), 40))}
        for one, c in zip(shown, change, strict=True)
    ]])  # fmt: skip
    assert changes["bow"].sum() == pytest.approx(1.0)
    assert changes["bow"][SIZES < 0.02].sum() > 0.95
    assert anew["bow"] == pytest.approx(0.5, abs=0.1) if of_departures else anew["bow"] < 0.05


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_it_is_learnt_whether_changes_of_an_instrument_are_alike(share: float) -> None:
    usual = np.where((SIZES > 0.005) & (SIZES < 1.0), 1.0, 1e-6)
    usual /= usual.sum()
    rng = np.random.default_rng(6)
    instruments = []
    for k in range(40):
        before, other = rng.choice(SIZES, 2, p=usual)
        after = before if k < 40 * share else other
        alike = told(usual, seen_as(float(before), 40))
        one = factors_alike(usual, alike, seen_as(float(after), 40))
        instruments.append({"bow": one, "missing: losses": np.zeros(one.size)})
    shares = learnt_alike(instruments)
    assert shares["mean"] == pytest.approx(share, abs=0.15)
    # what nothing is known of: either as likely
    assert shares["missing"] == pytest.approx(0.5)


def test_what_one_kind_leaves_open_others_tell() -> None:
    """Where nothing departs, whether it comes anew can't be seen; elsewhere it never does."""
    rng = np.random.default_rng(7)
    kinds, changes = [], []
    for typical in (1e-5, 0.1):
        had = typical * np.exp(0.5 * rng.standard_normal((30, 8)))
        kinds.append([{f"c{k}": seen_as(float(s), 40) for k, s in enumerate(one)} for one in had])
        still = seen_as(1e-5, 40)
        changes.append([{n: (own, still) for n, own in one.items()} for one in kinds[-1]])
    departures = learnt(kinds)
    learnt_of = learnt_changes([
        [{n: factors_of_change(known[n], *both) for n, both in one.items()} for one in instruments]
        for known, instruments in zip(departures, changes, strict=True)
    ])  # fmt: skip
    for _, anew in learnt_of:
        assert max(anew.values()) < 0.05
