"""Equation 10 and rounding: realised against claimed statistics."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensors.datasheet import Datasheet
from sensors.noise.uncertainty import gaussian_sd_mm, quantise, sigma_mm


def datasheet(resolution_um: float, repeatability_um: float | None) -> Datasheet:
    return Datasheet(
        name="a",
        working_distance_mm=400.0,
        z_range_mm=250.0,
        x_fov_mm=495.0,
        points_per_profile=100,
        z_resolution_um=resolution_um,
        profile_rate_hz=500.0,
        repeatability_um=repeatability_um,
    )


def test_sigma_is_equation_10() -> None:
    assert sigma_mm(datasheet(3.8, 0.0)) == pytest.approx(3.8e-3 / math.sqrt(12.0))
    assert sigma_mm(datasheet(3.8, None)) == pytest.approx(3.8e-3 / math.sqrt(12.0))
    assert sigma_mm(datasheet(0.0, 5.0)) == pytest.approx(5e-3)
    both = sigma_mm(datasheet(12.0, 5.0))
    assert both**2 == pytest.approx((12e-3) ** 2 / 12.0 + 5e-3**2)


def test_sigma_is_the_spread_of_a_uniform_error_and_the_repeatability() -> None:
    rng = np.random.default_rng(1)
    error = rng.uniform(-6e-3, 6e-3, 400_000) + rng.normal(0.0, 5e-3, 400_000)
    assert error.std() == pytest.approx(gaussian_sd_mm(12e-3, 5e-3), rel=0.005)


@given(st.floats(-500.0, 500.0), st.sampled_from([0.0038, 0.015, 0.02, 1.0 / 220.0]))
def test_rounding_goes_to_the_nearest_multiple(depth: float, step: float) -> None:
    rounded = float(quantise(np.array(depth), step))
    assert abs(rounded - depth) <= step / 2 * (1 + 1e-9) + 1e-12
    assert rounded / step == pytest.approx(round(rounded / step), abs=1e-6)


def test_rounding_shifts_no_depth_where_cutting_down_would_by_half_a_step() -> None:
    rng = np.random.default_rng(2)
    depth = rng.uniform(399.0, 401.0, 200_000)
    error = quantise(depth, 0.0038) - depth
    assert abs(error.mean()) < 1e-5
    assert error.std() == pytest.approx(0.0038 / math.sqrt(12.0), rel=0.01)


def test_missing_readings_stay_missing_and_no_step_changes_nothing() -> None:
    depth = np.array([np.nan, 1.2345])
    assert np.isnan(quantise(depth, 0.01)[0])
    np.testing.assert_array_equal(quantise(depth, 0.0), depth)


def test_rounding_in_place_gives_the_same_bits():
    depth = np.random.default_rng(3).uniform(100.0, 400.0, (7, 11))
    rounded = quantise(depth.copy(), 0.0038)
    assert quantise(depth, 0.0038, out=depth) is depth
    np.testing.assert_array_equal(depth, rounded)
