"""What a law leaves: the largest member of a known cause, as a curve of its component."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.components.component import components_of
from diagnosis.evidence.assess import Assessment, assessed_mean
from diagnosis.physics.remainder import curves_of, remainder
from tests.support.linear_readings import WIDE, LinearReadings


@pytest.fixture(scope="module")
def readings() -> LinearReadings:
    return LinearReadings.drawn({"line_bow": 0.5, "form_error": 0.2}, seed=1)


@pytest.fixture(scope="module")
def found(readings: LinearReadings) -> Assessment:
    return assessed_mean(readings.seen, {})


def test_only_known_causes_leave_a_remainder(found: Assessment) -> None:
    assert remainder(found, []) is None
    assert remainder(found, ["column_offset"]) is None
    one = remainder(found, ["form_error"])
    assert one is not None
    assert one.candidate.effect == "form_error"


def test_the_largest_remainder_comes_first(found: Assessment) -> None:
    one = remainder(found, ["form_error", "line_bow"])
    assert one is not None
    assert one.candidate.effect == "line_bow"


def test_a_curve_is_what_the_readings_hold_of_the_component(
    readings: LinearReadings, found: Assessment
) -> None:
    """Its coefficients are least squares' (4000 readings, shrunk by next to nothing)."""
    one = remainder(found, ["line_bow"])
    assert one is not None
    (curve,) = curves_of(one, readings.seen, 0.01)
    fitted = np.linalg.lstsq(readings.columns, readings.values, rcond=None)[0][:WIDE]
    assert curve.coefficients == pytest.approx(fitted, abs=0.01)
    assert curve.component.effect == "line_bow"


def test_a_curve_is_in_mm_whatever_its_columns_were_scaled_by(
    readings: LinearReadings, found: Assessment
) -> None:
    one = remainder(found, ["line_bow"])
    assert one is not None
    (plain,) = curves_of(one, readings.seen, 0.01)
    scaled = replace(readings.seen, turns={c.name: np.full(1, 3.0) for c in readings.components})
    (thrice,) = curves_of(one, scaled, 0.01)
    assert np.array(thrice.coefficients) == pytest.approx(3 * np.array(plain.coefficients))


def test_curves_hold_for_other_recordings_and_off_edges() -> None:
    for component in components_of("mean"):
        if component.own or component.relaxed.each == "profile" or component.relaxed.spanned:
            assert not component.is_curve, component.name
    assert not any(c.is_curve for c in components_of("scale"))
