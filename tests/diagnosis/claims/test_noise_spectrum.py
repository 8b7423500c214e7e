"""Spectra over a nominal one are even where nothing has changed; strips are where waves go."""

import numpy as np
import pytest

from diagnosis.claims.noise_spectrum import Spectra, products
from tests.support.spectra import (
    K_X,
    K_Y,
    NOMINAL,
    PITCH_X,
    PITCH_Y,
    READINGS,
    SPECKLE_POWER,
    noise_of,
    recordings,
)


def test_autocorrelations_of_whitened_readings_have_the_variance_of_their_number() -> None:
    spectra = Spectra.of(recordings(0.0, 0.0, (0.0,) * 40), NOMINAL)
    square = np.square(spectra.lags - spectra.lags.mean(axis=1)[:, None]).sum(axis=0).mean()
    assert square * spectra.readings[0] == pytest.approx(spectra.free, rel=0.15)
    # of N readings the mean of a squared wave over a spectrum has the variance 2 / N of its own
    wave = np.cos(2 * np.pi * (3 * spectra.x * PITCH_X / PITCH_Y + spectra.y))
    along = products(spectra.ratio, wave)
    expected = np.sqrt(2 * products(wave, wave) / spectra.readings[0])
    assert along.std() == pytest.approx(expected, rel=0.35)


@pytest.mark.parametrize("angle_deg", [10.0, 60.0, 140.0])
def test_a_strip_lies_across_its_ridges_without_a_level(angle_deg: float) -> None:
    spectra = Spectra.of([NOMINAL], NOMINAL)
    angle = np.radians(angle_deg)
    strips = spectra.strips(np.array([angle]), 0.05)[0]
    np.testing.assert_allclose(strips.mean(axis=1), 0, atol=1e-9)
    direction = np.arctan2(spectra.y, spectra.x)
    for strip, wavelength in zip(strips, (3.0, 6.0, 12.0), strict=True):
        at = int(np.argmax(strip * spectra.level[0]))
        far = np.hypot(spectra.x[at], spectra.y[at])
        assert far == pytest.approx(1 / wavelength, rel=0.3)
        # cos 2 is -1 across the ridges; the grid is coarse near its middle
        assert np.cos(2 * (direction[at] - angle)) < -0.8
        # as much as is in the strip is missing elsewhere at the same wavelengths
        sums = np.bincount(spectra.rings, strip)
        np.testing.assert_allclose(sums, 0, atol=1e-9 * np.abs(strip).sum())


def test_a_finish_without_a_direction_is_even() -> None:
    rough = SPECKLE_POWER / 3 + 20 * np.exp(-0.5 * (K_X**2 + K_Y**2) / 0.08**2)
    noise = noise_of(rough, np.random.default_rng(3), 4 * READINGS)
    spectra = Spectra.of([noise, NOMINAL], NOMINAL)
    assert spectra.level[0].max() > 3 * spectra.level[1].max()
    # what is left is little above the sampling noise of any spectrum
    one, other = products(spectra.ratio, spectra.ratio).diagonal()
    assert one < 5 * other
