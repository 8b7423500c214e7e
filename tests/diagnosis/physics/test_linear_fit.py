"""Robust least squares beside a placement."""

import numpy as np
import pytest

from diagnosis.model.model import Model
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.physics.linear_fit import _robust, _Rows
from sensors.effects.form_error import FormError, orders
from sensors.effects.line_bow import LineBow
from tests.support.effect_case import bench_workspace, taken_with


@pytest.mark.parametrize("spike", [30.0, 1000.0])
def test_readings_far_off_do_not_spoil_the_coefficient(spike: float) -> None:
    """A tenth of the readings, where the field is largest, are spikes of one sign; noise is 1."""
    rng = np.random.default_rng(1)
    count, truth = 6000, 2.0
    field = np.sort(rng.uniform(0, 3, count))
    columns = np.column_stack([np.ones(count), np.linspace(-1, 1, count) ** 2])
    values = truth * field + 0.7 * columns[:, 1] + rng.normal(size=count)
    values[-count // 10 :] += spike
    row = _Rows(
        white=field[:, None].astype(np.float32), columns=columns.astype(np.float32),
        values=values.astype(np.float32),
    )  # fmt: skip
    found = _robust(LineBow(), {0: row})[0]
    assert found[0] == pytest.approx(truth, rel=0.1)


def test_nothing_gained_without_coefficients() -> None:
    """A placement that is not the best yet is no gain of the field's."""
    rng = np.random.default_rng(4)
    columns = np.ones((3000, 1), dtype=np.float32)
    values = (5.0 + rng.normal(size=3000)).astype(np.float32)
    rows = _Rows(white=rng.normal(size=(3000, 1)).astype(np.float32), columns=columns,
                 values=values)  # fmt: skip
    assert rows.gain(np.zeros(1)) == 0
    assert abs(float(rows.unfitted.mean())) < 0.1


def test_a_form_has_the_waves_that_readings_bear() -> None:
    """2.5 periods over the part need more than the 14 waves that end at two."""
    sizes = {(2, 0): 60.0, (4, 0): 40.0, (5, 0): 40.0}
    true = FormError(coefficients_um=tuple(sizes.get(o, 0.0) for o in orders(20)))
    there = taken_with(bench_workspace("wedge"), "wedge", true)
    states = there.states(there.predict(Model()))
    few = FormError(coefficients_um=(0.0,) * 14)
    found, without = (
        fit_effect(FormError, there, Model(), states, start=start)
        for start in (None, few)
    )
    assert found is not None
    assert without is not None
    assert isinstance(found.effect, FormError)
    assert len(found.effect.coefficients_um) >= 20
    assert found.gain > without.gain + 500
