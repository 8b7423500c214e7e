"""What an instrument has when it is good: sizes told by its own recordings."""

import numpy as np
import pytest

from diagnosis.components.component import Component
from diagnosis.discrepancy.good_instrument import (
    alike_at_edges,
    informed,
    kinds_of,
    mean_factors,
)
from diagnosis.discrepancy.population import Kind, Population
from diagnosis.evidence.candidates import Candidate
from diagnosis.settings import SETTINGS
from sensors.effects.relaxed import Relaxed
from tests.support.linear_readings import LinearReadings


def likeliest(readings: LinearReadings, name: str) -> float:
    return float(readings.sizes[int(mean_factors(readings.seen)[name].argmax())])


def test_the_likelihood_peaks_at_the_size_that_is_there() -> None:
    for size in (0.1, 0.4):
        readings = LinearReadings.drawn({"line_bow": size}, seed=5)
        # coefficients of four columns scatter about their size
        assert 0.5 < likeliest(readings, "line_bow") / size < 2.0


def test_what_is_not_there_is_no_larger_than_the_noise_of_a_coefficient() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.4}, seed=5)
    factors = mean_factors(readings.seen)
    # four coefficients of 4000 readings: 2 of 63 of the noise
    assert factors["form_error"][readings.sizes > 0.1].max() < -1.0
    assert likeliest(readings, "incidence_bias") < 0.1


def test_what_two_components_could_explain_is_counted_once() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.4}, seed=6, alike=True)
    factors = mean_factors(readings.seen)
    most = sorted(float(factors[n].max()) for n in ("line_bow", "form_error"))
    assert most[1] > 100
    assert most[0] < 1.0


def test_a_baseline_moves_the_probability_to_the_size_that_it_shows() -> None:
    readings = LinearReadings.drawn({"line_bow": 0.4}, seed=5)
    flat = np.full(readings.sizes.size, 1.0 / readings.sizes.size)
    kinds = Population(kinds=(Kind(name="any", weights={"line_bow": flat}),))
    own = informed(kinds, kinds_of(kinds, {}, good=True), mean_factors(readings.seen))["line_bow"]
    assert own.sum() > 1 - 1e-9
    near = (readings.sizes > 0.1) & (readings.sizes < 1.6)
    assert own[near].sum() > 0.98


def test_what_baselines_show_at_edges_any_law_there_may_have_a_share_of() -> None:
    sizes = SETTINGS.mean_sizes()
    sharp = np.zeros(sizes.size)
    sharp[0] = 1.0
    shown = np.where(sizes == sizes[6], 20.0, 0.0)
    nothing = np.zeros(sizes.size)

    def candidate(name: str, at_edges: bool) -> Candidate:
        component = Component(name=name, effect=name, relaxed=Relaxed(channel="mean", spanned=True))
        return Candidate(
            name=name, effect=name, component=component, at=np.arange(1), at_edges=at_edges
        )

    three = [candidate("a", True), candidate("b", True), candidate("c", False)]
    usual = dict.fromkeys("abc", sharp)
    own = alike_at_edges(usual, {"a": shown, "b": nothing, "c": nothing}, three)
    share = sizes <= SETTINGS.doubt_at_edges * sizes[6]
    assert own["b"].sum() == pytest.approx(1.0)
    assert own["b"][share][-1] > 0.05
    assert own["b"][~share].sum() == 0
    assert np.array_equal(own["c"], sharp)
    calm = alike_at_edges(usual, dict.fromkeys("abc", nothing), three)
    assert np.array_equal(calm["b"], sharp)
