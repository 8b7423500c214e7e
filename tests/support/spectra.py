"""Noise of recordings of a part, with spectra that are known."""

import math

import numpy as np

from diagnosis.noise.noise_model import NoiseModel

LAGS, SIZE, READINGS = 24, 64, 18000
PITCH_X, PITCH_Y = 0.24, 0.3
ANGLE_DEG, STRIP, SHARE = 35.0, 0.05, 0.1
K_Y = np.fft.fftfreq(SIZE)[:, None] * np.ones(SIZE)
K_X = K_Y.T * PITCH_Y / PITCH_X
SPECKLE_POWER = 0.15 + 1.7 * np.exp(-0.5 * (K_X / 0.25) ** 2) * (1 - 0.5 * np.cos(2 * np.pi * K_Y))
SPECKLE_POWER /= SPECKLE_POWER.mean()


def strip(angle_deg: float) -> np.ndarray:
    """Power of ridges along a direction in the scan: a strip across it, of mean 1."""
    a = math.radians(angle_deg)
    power = np.exp(-0.5 * ((K_X * math.cos(a) + K_Y * math.sin(a)) / STRIP) ** 2)
    return np.asarray(power / power.mean())


def noise_of(power: np.ndarray, rng: np.random.Generator, readings: int) -> NoiseModel:
    """Noise with a spectrum, its whitened autocorrelation known from so many readings."""
    lag = rng.standard_normal((SIZE, SIZE)) / np.sqrt(readings)
    far = np.minimum(np.arange(SIZE), SIZE - np.arange(SIZE))
    lag[np.maximum(far[:, None], far) > LAGS] = 0
    lag[0, 0] = 0
    power = power * (1 + np.fft.fft2(lag + np.roll(lag[::-1, ::-1], 1, (0, 1))).real / 2**0.5)
    pick = np.arange(-LAGS, LAGS + 1)
    acf = np.fft.ifft2(power).real[np.ix_(pick, pick)]
    return NoiseModel(
        sd_mm=0.01, acf=acf / acf[LAGS, LAGS], tail_share=0.0, tail_sd_mm=0.1, missing_share=0.0,
        pitch_x_mm=PITCH_X, pitch_y_mm=PITCH_Y, readings=readings,
    )  # fmt: skip


def recordings(
    lay: float, own: float, headings: tuple[float, ...], *, scatter: float = 0.0, seed: int = 0
) -> list[NoiseModel]:
    """Draw recordings with shares of a lay of the part, of the sensor, and of each of them."""
    rng, found = np.random.default_rng(seed), []
    for heading in headings:
        power = SPECKLE_POWER + lay * strip(ANGLE_DEG - heading) + own * strip(20.0)
        power = power + scatter * strip(rng.uniform(0, 180))
        found.append(noise_of(power, rng, READINGS))
    return found


NOMINAL = noise_of(SPECKLE_POWER, np.random.default_rng(9), 4 * READINGS)
