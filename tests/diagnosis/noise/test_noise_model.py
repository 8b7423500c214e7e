"""The calibrated noise reproduces itself."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from diagnosis.noise.noise_model import calibrate, robust_sd


def correlated(rng: np.random.Generator, shape: tuple[int, int] = (160, 200)) -> np.ndarray:
    field = gaussian_filter(rng.standard_normal(shape), (0.8, 1.6), mode="wrap")
    return 0.01 * field / field.std() + 0.003 * rng.standard_normal(shape)


def test_calibration_of_correlated_noise_under_a_smooth_misfit() -> None:
    rng = np.random.default_rng(5)
    misfit = (
        0.05 * np.sin(np.linspace(0, 3, 200))[None, :] + 0.02 * np.linspace(-1, 1, 160)[:, None]
    )
    field = correlated(rng) + misfit
    field[40, 50] = 3.0  # a spike
    model = calibrate(
        [field], [np.ones(field.shape, bool)], pitch_mm=(0.1, 0.1), missing_share=0.0,
    )  # fmt: skip
    assert model.sd_mm == pytest.approx(np.hypot(0.01, 0.003), rel=0.05)
    ly, lx = model.lags
    # a Gaussian of standard deviation s convolved with white noise has acf exp(-lag² / 4 s²)
    share = 0.01**2 / (0.01**2 + 0.003**2)
    assert model.acf[ly, lx + 2] == pytest.approx(share * np.exp(-4 / (4 * 1.6**2)), abs=0.05)
    assert model.acf[ly + 1, lx] == pytest.approx(share * np.exp(-1 / (4 * 0.8**2)), abs=0.05)


def test_fields_of_the_spectrum_have_the_autocorrelation() -> None:
    rng = np.random.default_rng(6)
    model = calibrate(
        [correlated(rng)], [np.ones((160, 200), bool)], pitch_mm=(0.1, 0.1), missing_share=0.0,
    )  # fmt: skip
    # filtered white noise, on a torus that holds the shape and the lags
    root = np.sqrt(np.clip(model.spectrum((300, 400)), 0, None))
    white = np.fft.fft2(rng.standard_normal(root.shape))
    drawn = np.fft.ifft2(white * root).real[:300, :400]
    ly, lx = model.lags
    assert drawn.std() == pytest.approx(1.0, rel=0.025)
    for row, column in ((0, 1), (1, 0), (1, 2), (0, 5)):
        product = np.mean(drawn[row:, column:] * drawn[: 300 - row, : 400 - column])
        assert product == pytest.approx(model.acf[ly + row, lx + column], abs=0.03)


def test_counting_in_steps_adds_white_noise() -> None:
    field = correlated(np.random.default_rng(7), (400, 400))
    everywhere = [np.ones(field.shape, bool)]
    made = [
        calibrate([f], everywhere, pitch_mm=(0.1, 0.1), missing_share=0.0)
        for f in (field, np.round(field / 0.012) * 0.012)
    ]
    told = made[0].rounded(0.012)
    assert told.sd_mm == pytest.approx(made[1].sd_mm, rel=0.03)
    assert np.allclose(told.acf, made[1].acf, atol=0.05)


@pytest.mark.parametrize("step", [0.2, 0.5, 1.0])
def test_a_scale_of_counts_is_that_of_the_noise_and_the_counting(step: float) -> None:
    z = np.random.default_rng(8).standard_normal(20_000)
    counted = np.round(z / step) * step
    assert robust_sd(counted) == pytest.approx(np.hypot(1.0, step / np.sqrt(12)), rel=0.025)


def test_a_scale_bears_outliers() -> None:
    z = np.random.default_rng(9).standard_normal(20_000)
    assert robust_sd(z) == pytest.approx(1.0, rel=0.025)
    z[:1000] += 1e6
    assert robust_sd(z) < 1.15
    assert robust_sd(np.zeros(0)) == 0.0
    assert robust_sd(np.ones(50)) == 0.0
