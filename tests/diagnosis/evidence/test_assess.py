"""What readings need: causes that are named, withheld or refuted, with and without baselines."""

import numpy as np
import pytest

from diagnosis.discrepancy.good_instrument import informed, kinds_of, mean_factors
from diagnosis.discrepancy.population import Kind, Population, population
from diagnosis.evidence.assess import assessed_mean
from diagnosis.evidence.seen import seen
from diagnosis.model.model import Model
from diagnosis.prepare import Prepared
from tests.support.linear_readings import LinearReadings


@pytest.mark.slow
def test_baselines_show_what_a_population_hides(bowed: Prepared) -> None:
    """A bow of a fifth of the noise: usual among instruments, but new on this one."""
    fitted = [p for p in bowed.patches if p.fit.any()]
    now = seen(fitted, bowed.noise, Model())
    usual = population().of_files("even_angle")
    kinds = kinds_of(usual, mean_factors(now), good=False)
    alone = assessed_mean(now, usual.of_kinds(kinds))
    before = seen(bowed.baseline, bowed.noise, Model(), like=now)
    known = assessed_mean(now, informed(usual, kinds, mean_factors(before)), before)
    assert [m.candidate.effect for m in known.mean] == ["line_bow"]
    assert known.mean[0].nats > max((m.nats for m in alone.mean), default=0.0)
    # the same recordings as their own baseline: nothing has changed
    same = seen([p for p in bowed.patches if p.fit.any()], bowed.noise, Model(), like=now)
    still = assessed_mean(now, informed(usual, kinds, mean_factors(same)), same)
    assert not [m for m in still.mean if not m.candidate.at_edges]


def test_probabilities_of_a_place_add_up(bowed: Prepared) -> None:
    now = seen([p for p in bowed.patches if p.fit.any()], bowed.noise, Model())
    for member in assessed_mean(now, {}).mean:
        assert sum(member.shares.values()) == pytest.approx(1.0)
        assert "" in member.shares


def test_a_cause_that_is_withheld_is_found_without_its_name() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.3}, seed=1)
    (named,) = assessed_mean(readings.seen, {}).mean
    assert named.candidate.effect == "line_bow"
    found = assessed_mean(readings.seen, {}, withheld=frozenset({"line_bow"}))
    (nameless,) = found.mean
    assert nameless.candidate.name == named.candidate.name
    assert nameless.candidate.effect == ""
    assert found.effects["mean"]["line_bow"] == ""
    # the rarer before any reading, by as much as the settings say; as clear from the readings
    assert nameless.nats == pytest.approx(named.nats)


def test_a_refuted_cause_is_no_candidate() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.3}, seed=1)
    assert not assessed_mean(readings.seen, {}, refuted=["line_bow"]).mean


def test_what_baselines_have_as_well_is_no_change() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.3}, seed=1)
    again = LinearReadings.drawn({"line_bow": 0.3}, seed=1, noise_seed=2)
    any_size = np.full(readings.sizes.size, 1.0 / readings.sizes.size)
    kinds = Population(kinds=(Kind(name="any", weights={"line_bow": any_size}),))

    def changed(baseline: LinearReadings) -> bool:
        usual = informed(kinds, kinds_of(kinds, {}, good=True), mean_factors(baseline.seen))
        return bool(assessed_mean(readings.seen, usual, baseline.seen).mean)

    assert changed(LinearReadings.drawn({}, seed=1))
    assert not changed(again)
