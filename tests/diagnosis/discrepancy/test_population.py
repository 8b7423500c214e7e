"""What is learnt of good instruments' discrepancy, and what baselines add."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.discrepancy.good_instrument import informed, kinds_of, told_by_changes
from diagnosis.discrepancy.learning import learnt
from diagnosis.discrepancy.population import (
    Kind,
    Population,
    population,
)
from diagnosis.evidence.changed_sizes import changed
from diagnosis.evidence.seen import RATES
from diagnosis.settings import SETTINGS
from tests.support.seen_sizes import SIZES, seen_as


def of_two(names: tuple[str, ...] = ("bow", "lens", "slips")) -> Population:
    """A kind of instruments that are perfect, and one of which each has a tenth of everything."""
    perfect, usual = (learnt([[{"bow": seen_as(s)}] * 20])[0]["bow"] for s in (1e-5, 0.1))
    return Population(
        kinds=(
            Kind(name="perfect", weights=dict.fromkeys(names, perfect)),
            Kind(name="usual", weights=dict.fromkeys(names, usual)),
        )
    )


def test_a_baseline_narrows_what_an_instrument_may_have() -> None:
    flat = Kind(name="any", weights={"bow": np.full(SIZES.size, 1 / SIZES.size)})
    here = Population(kinds=(flat,))
    after = informed(here, kinds_of(here, {}, good=True), {"bow": seen_as(1e-5)})
    assert after["bow"].sum() == pytest.approx(1.0)
    assert after["bow"][SIZES > 0.1].sum() < 1e-3


def test_recordings_show_their_kind() -> None:
    here = of_two()
    nothing = {n: seen_as(1e-5) for n in ("bow", "lens", "slips")}
    everything = {n: seen_as(0.1) for n in ("bow", "lens", "slips")}
    assert kinds_of(here, nothing, good=False)["mean"][0] > 0.99
    assert kinds_of(here, everything, good=False)["mean"][1] > 0.99
    # one that has nothing else of the kind has changed
    assert kinds_of(here, nothing | {"bow": seen_as(0.1)}, good=False)["mean"][0] > 0.8


def test_a_kind_says_nothing_but_of_edges_where_columns_lie_otherwise() -> None:
    flat = np.full(3, 1 / 3)
    own = Kind(name="a", weights={n: flat for n in (
        "bow", "law: finite_spot", "scale: light_falloff", "missing: light_falloff",
    )}, columns="even_x")
    here = Population(kinds=(own,))
    assert here.of_files("even_x").kinds[0].weights.keys() == own.weights.keys()
    assert here.of_files("even_angle").kinds[0].weights.keys() == {"law: finite_spot"}


def test_what_no_kind_was_seen_to_have_is_as_in_the_others() -> None:
    one = Kind(name="a", weights={"bow": np.full(3, 1 / 3)})
    both = Population(kinds=(one, Kind(name="b", weights={})))
    weights = both.weights("bow")
    assert weights is not None
    assert weights[1] == pytest.approx(weights[0])
    assert both.weights("slips") == pytest.approx(weights)
    assert both.weights("scale: slips") is None


def test_the_population_is_named_and_its_probabilities_add_up() -> None:
    found = population()
    assert "calibration" in found.name
    for kind in found.kinds:
        assert kind.weights
        for name, weights in kind.weights.items():
            grid = SETTINGS.rate_sizes() if name.partition(": ")[0] in RATES else SIZES
            assert weights.shape == grid.shape, name
            assert weights.sum() == pytest.approx(1.0, abs=1e-4), name


def test_an_instrument_may_be_unlike_all_kinds() -> None:
    sharp = np.zeros(SIZES.size)
    sharp[0] = 1.0
    rough = np.zeros(SIZES.size)
    rough[6] = 1.0
    here = Population(kinds=(Kind(name="any", weights={"bow": sharp, "lens": rough}),))
    # of what a kind never has it may have what the kind has of another component
    (bow,) = here.weights("bow")
    assert bow.sum() == pytest.approx(1.0)
    assert bow[0] == pytest.approx(0.75)
    assert bow[6] == pytest.approx(0.25)
    assert here.weights("scale: never seen") is None


def test_in_a_kind_that_was_never_seen_sizes_lie_further_apart() -> None:
    sharp = np.eye(SIZES.size)[4]
    kind = Kind(name="any", weights={"bow": sharp, "law: finite_spot": sharp})
    near, far = (
        Population(kinds=(kind,), apart_by=by) for by in ({}, {"mean": 1.0, "edges": 0.0})
    )
    as_known, drawn = (p.apart("bow") for p in (near, far))
    assert as_known is not None
    assert drawn is not None
    assert as_known[1] == pytest.approx(sharp)
    assert drawn[0] == pytest.approx(as_known[0])
    assert drawn[1].sum() == pytest.approx(1.0)
    # a normal density three standard deviations off, over that in the middle
    assert drawn[1][7] / drawn[1][4] == pytest.approx(np.exp(-4.5))
    at_edges = [p.apart("law: finite_spot") for p in (near, far)]
    assert at_edges[0] is not None
    assert at_edges[1] is not None
    assert at_edges[0][1] == pytest.approx(at_edges[1][1])


@pytest.mark.parametrize("makes", [1, 70])
def test_at_edges_an_unlike_make_is_as_a_changed_one(makes: int) -> None:
    """No size there is more than K + 1 times likelier in a changed instrument, of K makes."""
    sharp = np.array([0.9, 0.1, 0.0, 0.0])
    one = Population(kinds=(Kind(name="a", weights={"law: finite_spot": sharp}, makes=makes),
                            Kind(name="b", weights={})))  # fmt: skip
    weights = one.weights("law: finite_spot")
    assert weights is not None
    assert weights[0] == pytest.approx((makes * sharp + changed(sharp)) / (makes + 1))
    ratio = changed(sharp) / weights[0]
    assert ratio.max() == pytest.approx(makes + 1, rel=1e-3)


def test_the_more_kinds_were_seen_the_less_another_one_may_be_unlike_them() -> None:
    sharp, rough = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    many = Population(kinds=tuple(
        Kind(name=name, weights={"bow": sharp, "lens": rough}, makes=makes)
        for name, makes in (("a", 1), ("b", 1), ("c", 70))
    ))  # fmt: skip
    weights = many.weights("bow")
    assert weights is not None
    # one in four kinds is yet another; it has what is known of any component
    assert weights[:, 3] == pytest.approx(0.25 * 0.5)


def test_an_instrument_that_is_unlike_in_what_it_has_is_so_in_what_it_changes_by() -> None:
    """The share of unlike instruments counts once: not in the departure and in the change."""
    small, large = np.eye(SIZES.size)[1], np.eye(SIZES.size)[-2]
    kind = Kind(name="like", weights={"bow": small, "tilt": large},
                changes={"bow": small, "tilt": large})  # fmt: skip
    here = Population(kinds=(kind,))
    kinds = kinds_of(here, {}, good=True)
    told = told_by_changes(here, kinds, {}, {})["bow"]
    assert told[5:].sum() == pytest.approx(0.5 * here.unlike("bow"))
    # baselines that show an unlike departure show such an instrument
    beside = told_by_changes(here, kinds, {"bow": seen_as(float(SIZES[-2]))}, {})["bow"]
    assert beside[5:].sum() == pytest.approx(0.5, rel=0.1)


def test_baselines_without_a_law_at_edges_are_of_no_unlike_instrument() -> None:
    """What edges of theirs show says how unlike the instrument is; nothing else of the next."""
    small = np.eye(SIZES.size)[1]
    name = "law: finite_spot"
    kind = Kind(name="like", weights={name: small}, changes={name: small}, anew={name: 0.5})
    here = Population(kinds=(kind,))
    kinds = kinds_of(here, {}, good=True)
    usual = told_by_changes(here, kinds, {}, {})[name]
    still, large = (
        told_by_changes(here, kinds, {name: seen_as(size)}, {})[name] for size in (1e-5, 0.3)
    )
    assert still[4:].sum() < 0.25 * usual[4:].sum()
    assert large[4:].sum() > 1.5 * usual[4:].sum()
    # of a known kind the next departs as another instrument, whatever these show
    known = replace(here, share=1e-9)
    every = [told_by_changes(known, kinds, {name: seen_as(s)}, {})[name] for s in (1e-5, 0.02)]
    assert every[0] == pytest.approx(every[1], abs=1e-6)


def test_one_small_change_is_no_promise_of_the_next() -> None:
    flat = np.full(SIZES.size, 1 / SIZES.size)
    here = Population(kinds=(Kind(name="any", weights={"bow": flat}, changes={"bow": flat}),))
    kinds = kinds_of(here, {}, good=True)
    told = told_by_changes(here, kinds, {}, {"bow": seen_as(1e-5)})["bow"]
    assert told.sum() == pytest.approx(1.0)
    assert told[SIZES > 0.1].sum() == pytest.approx(0.5 * flat[SIZES > 0.1].sum(), rel=0.05)
    assert told[0] > 2 / SIZES.size


def test_what_changes_anew_is_as_large_as_what_there_was() -> None:
    flat, least = np.full(SIZES.size, 1 / SIZES.size), np.eye(SIZES.size)[0]
    for share in (0.0, 0.4):
        kind = Kind(name="any", weights={"bow": flat}, changes={"bow": least}, anew={"bow": share})
        here = Population(kinds=(kind,))
        kinds = kinds_of(here, {}, good=True)
        told = told_by_changes(here, kinds, {"bow": seen_as(float(SIZES[4]), 40)}, {})["bow"]
        assert told.sum() == pytest.approx(1.0)
        assert told[3:6].sum() == pytest.approx(share, rel=0.1)
        # no baseline that shows nothing lets the next recording depart as another instrument's
        assert told[8:].sum() < 1e-3
        without = told_by_changes(here, kinds, {"bow": seen_as(1e-5, 40)}, {})["bow"]
        assert without[4:].sum() < 0.01
        # what no kind was seen to change by comes anew as often as what is weighed like it
        assert here.anew("tilt")[1] == share


def test_what_baselines_changed_by_counts() -> None:
    law, small = "law: motion_blur (nominal)", np.eye(SIZES.size)[1]
    sizes = np.exp(-0.5 * np.square(np.log(SIZES / 0.05)))
    sizes /= sizes.sum()
    here = Population(kinds=(Kind(name="any", weights={law: small}, changes={law: sizes}),))
    kinds = kinds_of(here, {}, good=True)
    without = told_by_changes(here, kinds, {}, {})[law]
    assert without == pytest.approx(here.of_changes.of_kinds(kinds)[law])
    among = {law: seen_as(1e-5)}
    assert told_by_changes(here, kinds, {}, among)[law][0] > without[0]
    # as far as the next change of a good instrument is like its last one
    of_another = replace(here, alike={"edges": 0.0})
    assert told_by_changes(of_another, kinds, {}, among)[law] == pytest.approx(without)


def test_a_law_that_is_measured_is_off_by_no_more_than_one_that_is_nominal() -> None:
    nominal = np.array([0.1, 0.8, 0.1, 1e-9, 1e-9])
    many = Kind(name="many", weights={"law: motion_blur (nominal)": nominal}, makes=70)
    one = Kind(name="one", weights={"law: motion_blur (listed)": np.array([0.8, 0.2, 0, 0, 0])})
    alone = Population(kinds=(one,)).weights("law: motion_blur (listed)")
    beside = Population(kinds=(one, many)).weights("law: motion_blur (listed)")
    assert alone is not None
    assert beside is not None
    # of one make, an unlike one has what changed ones have; of many nominal ones, hardly so
    assert alone[0, -1] > 0.05
    assert 1e-4 < beside[0, -1] < 0.1 * alone[0, -1]
    assert beside[0, 0] == pytest.approx(0.5 * 0.8 + 0.5 * nominal[0], abs=0.01)


@pytest.mark.parametrize("instruments", [1, 30])
def test_what_files_list_as_measured_was_measured_on_each_instrument(instruments: int) -> None:
    """Of two measured laws one part in 2 N + 1 is as of nominal ones, of N instruments."""
    own, nominal = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    laws = "finite_spot", "motion_blur"
    one = Kind(name="one", weights={f"law: {n} (listed)": own for n in laws},
               instruments=instruments)  # fmt: skip
    many = Kind(name="many", weights={f"law: {n} (nominal)": nominal for n in laws}, makes=10**6)
    weights = Population(kinds=(one, many)).weights("law: finite_spot (listed)")
    assert weights is not None
    assert weights[0, -1] == pytest.approx(1 / (2 * instruments + 1), rel=1e-3)
