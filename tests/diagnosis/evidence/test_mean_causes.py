"""Sets of causes: what is there is found, what isn't is not, what can't be told is shared."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence.candidates import Candidate
from diagnosis.evidence.mean_causes import (
    Active,
    CauseSearch,
    Member,
    Scales,
    Weighed,
    Weighing,
)
from diagnosis.evidence.posterior import World
from diagnosis.settings import SETTINGS
from tests.support.linear_readings import WIDE, LinearReadings


def found_in(readings: LinearReadings, baseline: LinearReadings | None = None) -> list[Member]:
    world = World(
        found=readings.gram.equations,
        baseline=None if baseline is None else baseline.gram.equations,
    )
    scales = Scales(sizes=readings.sizes, weights={})
    return CauseSearch({False: world, True: world}, readings.candidates, scales, scales).search()[0]


def test_causes_that_are_there_are_found_with_their_sizes() -> None:
    found = found_in(LinearReadings.drawn({"line_bow": 0.5, "form_error": 0.2}, seed=1))
    assert [m.candidate.effect for m in found] == ["line_bow", "form_error"]
    for member, size in zip(found, (0.5, 0.2), strict=True):
        assert 0.5 < member.size / size < 2.0
        assert member.shares[member.candidate.name] > 0.99
        assert np.sqrt(np.mean(np.square(member.coefficients))) == pytest.approx(size, rel=0.5)


def test_noise_has_causes_no_more_often_than_they_are_probable_before() -> None:
    """A Bayes factor above 1/p is as rare as p where nothing is there (Markov's inequality)."""
    named = [found_in(LinearReadings.drawn({}, seed=seed)) for seed in range(200)]
    prior = np.exp(SETTINGS.log_odds("line_bow"))
    assert np.mean([bool(m) for m in named]) < 3 * prior
    assert max((m.nats for found in named for m in found), default=0.0) < np.log(200 * 3 * 3)


def test_causes_of_the_same_columns_share_their_place() -> None:
    """Columns turned among themselves draw the same functions: no reading tells the two apart."""
    (member,) = found_in(LinearReadings.drawn({"line_bow": 0.3}, seed=2, alike=True))
    assert member.shares["line_bow"] == pytest.approx(0.5, abs=1e-3)
    assert member.shares["form_error"] == pytest.approx(0.5, abs=1e-3)
    assert sum(member.shares.values()) == pytest.approx(1.0)


def test_the_evidence_grows_with_the_square_of_the_signal() -> None:
    """For N readings of a signal of rms s in k columns: N s² / 2 less k/2 ln N s², about."""
    nats = [found_in(LinearReadings.drawn({"line_bow": s}, seed=3))[0].nats for s in (0.2, 0.4)]
    for nat, size in zip(nats, (0.2, 0.4), strict=True):
        signal = 4000 * size**2
        assert nat == pytest.approx(signal / 2 - 2 * np.log(signal), rel=0.25)


def test_usual_departures_are_no_causes() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.1}, seed=4)
    worlds = dict.fromkeys((False, True), World(found=readings.gram.equations))
    usual = np.where(np.isclose(readings.sizes, 0.128), 1.0, 0.0)
    scales = [Scales(sizes=readings.sizes, weights=w) for w in ({}, {"line_bow": usual})]
    searches = [CauseSearch(worlds, readings.candidates, s, s) for s in scales]
    assert [len(s.search()[0]) for s in searches] == [1, 0]


def test_a_cause_is_found_beside_what_a_good_instrument_has_more_of() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.3, "form_error": 0.1}, seed=4)
    worlds = dict.fromkeys((False, True), World(found=readings.gram.equations))
    few, most = (np.where(np.isclose(readings.sizes, size), 1.0, 0.0) for size in (0.256, 0.002))
    scales = Scales(sizes=readings.sizes, weights={"line_bow": 0.4 * few + 0.6 * most})
    search = CauseSearch(worlds, readings.candidates, scales, scales)
    (found,), (habit,) = search.search()
    assert found.candidate.effect == "form_error"
    assert found.shares["form_error"] > 0.99
    assert habit.component.effect == "line_bow"
    assert habit.nats > 100
    assert 0.0 < habit.fault < 1.0
    # beside it nothing is left that could be a cause: what is usual needs no more looking at
    form = next(c for c in readings.candidates if c.effect == "form_error")
    assert [c.effect for c, _, _ in search.usual_beside([])] == ["line_bow"]
    assert search.usual_beside([(form, 0, 0.128)]) == []


def test_off_edges_a_law_is_held_against_what_good_instruments_have_off_edges() -> None:
    """Where the surface runs on they have little of it: there a tenth of it is seen."""
    readings = LinearReadings.drawn({"finite_spot": 0.1}, seed=4, effects=("finite_spot",))
    worlds = dict.fromkeys((False, True), World(found=readings.gram.equations))
    (surface,) = readings.candidates
    at_edges = replace(surface, name="finite_spot at edges", at_edges=True)
    few, many = (1.0 * np.isclose(readings.sizes, size) for size in (0.002, 0.512))
    scales = Scales(
        sizes=readings.sizes, weights={surface.key: few, at_edges.key: many}
    )
    quiet = scales.deviations([surface, at_edges], WIDE)
    assert (quiet[False][0], quiet[True][0]) == (0.002, 0.512)
    (found,), _ = CauseSearch(worlds, [surface, at_edges], scales, scales).search()
    assert found.candidate is surface
    assert found.gain > 10


def test_what_follows_a_covariate_is_the_same_at_edges() -> None:
    readings = LinearReadings.drawn({}, seed=4)
    usual = 1.0 * np.isclose(readings.sizes, 0.128)
    scales = Scales(sizes=readings.sizes, weights={"line_bow": usual})
    quiet = scales.deviations(readings.candidates, len(readings.gram.right))
    assert np.array_equal(quiet[False], quiet[True])
    assert quiet[True].max() == 0.128


def test_what_no_size_explains_is_no_change() -> None:
    sizes = SETTINGS.mean_sizes()
    scales = Scales(sizes=sizes, weights={})
    assert scales.nats("any", np.full(sizes.size, -100.0)) == pytest.approx(-100.0)
    assert scales.nats("any", np.where(sizes > 0.1, 20.0, 0.0)) > 15


def test_a_change_is_held_against_what_changes_in_good_instruments() -> None:
    """One that departs by 0.1, as its baselines do, and then by another 0.1."""
    before = LinearReadings.drawn({"line_bow": 0.1}, seed=4)
    now = LinearReadings.drawn({"line_bow": 0.2}, seed=4, noise_seed=5)
    world = World(found=now.gram.equations, baseline=before.gram.equations)
    worlds, sizes = dict.fromkeys((False, True), world), now.sizes
    departures = Scales(sizes=sizes, weights={"line_bow": 1.0 * np.isclose(sizes, 0.128)})
    still = Scales(sizes=sizes, weights={"line_bow": 1.0 * np.isclose(sizes, 0.002)})
    for changes, found in ((departures, 0), (still, 1)):
        search = CauseSearch(worlds, now.candidates, changes, departures)
        assert len(search.search()[0]) == found


def test_changes_are_larger_than_what_most_good_instruments_have() -> None:
    sizes = SETTINGS.mean_sizes()
    weights = np.zeros(sizes.size)
    weights[4:7] = 0.2, 0.6, 0.2
    scales = Scales(sizes=sizes, weights={"line_bow": weights})
    assert scales.typical("line_bow") == sizes[5]
    changed = scales.changed("line_bow")
    assert changed.sum() == pytest.approx(1.0)
    assert changed[:6].sum() < 1e-9
    # each size half as likely as one four times smaller
    assert changed[6] / changed[8] == pytest.approx(2.0)
    # nothing is known of another component: it is among the smallest
    assert scales.typical("form_error") <= sizes[SETTINGS.small_sizes - 1]


@pytest.mark.parametrize(
    ("beside_bow", "beside_form", "best"),
    [
        ({"line_bow": -9, "form_error": 9}, {"line_bow": 9, "form_error": -9}, None),
        ({"line_bow": 9, "form_error": 20}, {"line_bow": 9, "form_error": -9}, "line_bow"),
        ({"line_bow": 9, "form_error": 20}, {"line_bow": 9, "form_error": 20}, "form_error"),
        ({"line_bow": 9, "form_error": -9}, {}, "line_bow"),
    ],
)
def test_a_cause_is_picked_where_it_stands_with_its_own_law_in_doubt(
    monkeypatch: pytest.MonkeyPatch,
    beside_bow: dict[str, float],
    beside_form: dict[str, float],
    best: str | None,
) -> None:
    """The search is told the nats of each candidate, by the one whose law is in doubt."""
    readings = LinearReadings.drawn({}, seed=1)
    worlds = dict.fromkeys((False, True), World(found=readings.gram.equations))
    scales = Scales(sizes=readings.sizes, weights={})
    other = {"incidence_bias": -9.0}
    nats = {
        "": {"line_bow": 30.0, "form_error": -60.0, **other},
        "line_bow": {**beside_bow, **other}, "form_error": {**beside_form, **other},
    }  # fmt: skip

    def in_doubt(active: Sequence[Active], tried: Sequence[Active] = ()) -> str:
        return "".join(c.name for c, _, _ in (*active, *tried))

    def told(doubted: str, candidates: Sequence[Candidate]) -> Weighing:
        causes = {
            c.name: Weighed(nats=nats[doubted][c.name], variant=0, size=1.0) for c in candidates
        }
        return Weighing(causes=causes, usual=None, habit=None, hides=False)

    search = CauseSearch(worlds, readings.candidates, scales, scales)
    monkeypatch.setattr(search, "posteriors", in_doubt)
    monkeypatch.setattr(search, "weigh", told)
    found, weighing = search._best([])
    assert (None if found is None else found[0].name) == best
    assert weighing.usual is None
