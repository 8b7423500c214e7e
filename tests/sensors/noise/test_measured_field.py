"""The field's realised autocorrelation, heights and moments are those that it states."""

from dataclasses import replace

import numpy as np
import pytest

from sensors.noise.autocorrelation import autocovariance, measured_field
from sensors.noise.correlation import speckle_kernel
from sensors.noise.heights import HeightMap
from sensors.noise.lay import sample_lay
from sensors.noise.measured_field import LAGS, MeasuredField, mapped, standardised
from sensors.noise.noise_target import NoiseTarget, simulate

# neighbouring profiles correlate negatively, neighbouring points positively: overlapping speckle
CORRELATION = ((0.0, -0.3, 0.0), (0.15, 1.0, 0.15), (0.0, -0.3, 0.0))
FIELD = MeasuredField(amplitude_mm=0.02, cell_x_mm=0.1, cell_y_mm=0.2, correlation=CORRELATION)
X, Y = 0.1 * np.arange(150), 0.2 * np.arange(150)


def realised(field: MeasuredField, x: np.ndarray, y: np.ndarray, count: int = 4) -> np.ndarray:
    """Return the mean autocovariance of drawn fields at lags of -1, 0 and 1 steps."""
    each = [autocovariance(field.sample(x, y, np.random.default_rng(k))) for k in range(count)]
    return np.mean(each, axis=0)[LAGS - 1 : LAGS + 2, LAGS - 1 : LAGS + 2]


def test_the_realised_autocovariance_is_the_stated_one():
    found = realised(FIELD, X, Y)
    assert found[1, 1] == pytest.approx(FIELD.amplitude_mm**2, rel=0.03)
    assert np.allclose(found / found[1, 1], CORRELATION, atol=0.02)


@pytest.mark.parametrize("steps", [(0.5, 0.5), (1.3, 0.7)])
def test_on_other_grids_it_is_the_closed_form(steps):
    x, y = X * steps[0], Y * steps[1]
    found = realised(FIELD, x, y)
    lag_x, lag_y = x[1] * np.arange(-1, 2), y[1] * np.arange(-1, 2)
    assert found[1, 1] == pytest.approx(FIELD.amplitude_mm**2, rel=0.06)
    assert np.allclose(found / found[1, 1], FIELD.correlation_at(lag_x, lag_y), atol=0.03)


def test_the_sum_is_nearly_normal():
    drawn = np.concatenate([FIELD.sample(X, Y, np.random.default_rng(k)) for k in range(4)])
    z = drawn / drawn.std()
    assert abs(np.mean(z)) < 0.02
    assert abs(np.mean(z**3)) < 0.04
    assert abs(np.mean(z**4) - 3) < 0.15


def test_a_strip_is_the_part_of_the_whole():
    whole = FIELD.sample(X, Y, np.random.default_rng(3))
    strip = FIELD.sample(X[40:60], Y[::-1][:9], np.random.default_rng(3))
    assert np.array_equal(strip, whole[::-1][:9, 40:60])


def test_a_lay_draws_the_field_out_along_its_direction():
    ratio, angle = 4.0, np.pi / 2
    drawn = [sample_lay(FIELD, X, Y, ratio, angle, np.random.default_rng(k)) for k in range(4)]
    found = np.mean([autocovariance(z) for z in drawn], axis=0)
    stated = FIELD.correlation_at(
        0.1 * np.arange(-1, 2), 0.2 * np.arange(-1, 2), lay_ratio=ratio, lay_angle_rad=angle
    )
    near = found[LAGS - 1 : LAGS + 2, LAGS - 1 : LAGS + 2] / found[LAGS, LAGS]
    assert np.allclose(near, stated, atol=0.03)
    kernel = speckle_kernel(FIELD, 0.1, 0.2, lay_ratio=ratio, lay_angle_rad=angle)
    middle = tuple(size // 2 for size in kernel.shape)
    assert kernel[middle] == pytest.approx(1.0)


def test_the_kernel_holds_all_correlated_lags():
    kernel = speckle_kernel(FIELD, 0.1, 0.2)
    middle = tuple(size // 2 for size in kernel.shape)
    near = kernel[middle[0] - 1 : middle[0] + 2, middle[1] - 1 : middle[1] + 2]
    assert np.allclose(near, CORRELATION, atol=0.01)
    assert np.abs(kernel[[0, -1]]).max() < 0.01
    assert np.abs(kernel[:, [0, -1]]).max() < 0.01


def test_a_map_of_heights_has_the_moments_and_the_correlation_that_it_states():
    heights = HeightMap(knots=(-3.0, -1.0, 0.0, 1.0, 3.0), values=(-1.5, -0.7, -0.3, 0.7, 5.0))
    field = replace(FIELD, heights=heights, amplitude_mm=0.01)
    drawn = np.stack([field.sample(X, Y, np.random.default_rng(k)) for k in range(4)])
    mean, sd = field.moments_mm()
    assert drawn.mean() == pytest.approx(mean, abs=0.02 * sd)
    assert drawn.std() == pytest.approx(sd, rel=0.03)
    found = realised(field, X, Y)
    stated = field.correlation_at(0.1 * np.arange(-1, 2), 0.2 * np.arange(-1, 2))
    assert np.allclose(found / found[1, 1], stated, atol=0.03)
    wanted = np.array([-0.3, 0.0, 0.5, 1.0])
    assert mapped(standardised(wanted, heights), heights) == pytest.approx(wanted, abs=1e-4)


def test_the_noise_of_a_simulated_plate_is_measured_and_simulated_again():
    wanted = NoiseTarget(
        rq_mm=0.02, pitch_x_mm=0.1, pitch_y_mm=0.2, profiles=150, points=150, resolution_mm=0.004,
        repeatability_mm=0.008,
    )  # fmt: skip

    def plate(field: MeasuredField, seed: int) -> np.ndarray:
        rngs = np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1])
        form = 0.01 * np.arange(150)[:, None]
        return simulate(field, wanted, *rngs, depth_mm=form) - form

    found = measured_field(plate(FIELD, 1), 0.1, 0.2, resolution_mm=0.004, repeatability_mm=0.008)
    # the sensor's own uncertainty is no speckle: it would be added twice
    assert found.moments_mm()[1] == pytest.approx(FIELD.amplitude_mm, rel=0.05)
    near = np.array(found.correlation)[LAGS - 1 : LAGS + 2, LAGS - 1 : LAGS + 2]
    assert np.allclose(near, CORRELATION, atol=0.05)
    first, again = autocovariance(plate(FIELD, 2)), autocovariance(plate(found, 3))
    assert np.allclose(again / first[LAGS, LAGS], first / first[LAGS, LAGS], atol=0.06)


def test_an_uneven_table_is_refused():
    with pytest.raises(ValueError, match="odd number of rows"):
        replace(FIELD, correlation=((1.0, 0.1),))
    with pytest.raises(ValueError, match="steps of the grid"):
        replace(FIELD, cell_x_mm=0.0)
