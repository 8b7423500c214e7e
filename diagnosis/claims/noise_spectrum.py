"""Spectra of a part's noise over a nominal one, and strips of waves in them.

Ridges with one direction on the part are waves across them: a strip of the spectrum through its
middle, narrow along the ridges.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.fields import Field, Mask
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS

GRID = 64
"""Frequencies along each axis: a torus that holds the lags of a `NoiseModel`, ±24."""
WAVELENGTHS = 1.5 * 2.0 ** np.arange(SETTINGS.claims.lay_octaves + 2)
"""Octaves of wavelengths, coarser pitches, about the sampling's limit, 2, in the first of them."""
WIDTHS = SETTINGS.claims.lay_widest * 0.5 ** np.arange(SETTINGS.claims.lay_widths)
"""Standard deviations of strips, per coarser pitch."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Spectra:
    """Spectra over the nominal one, but for their levels, less 1.

    Attributes
    ----------
    ratio : (R, F) float64
        At half of the frequencies; the other half is the same.
    lags : (L, R) float64
        Autocorrelations of the whitened readings, as far as `lay_reach`.
    free : float
        How many of them are independent: frequencies are left out.
    readings : (R,) float64
        Which they were measured from: an autocorrelation at one lag has the variance 1 / readings.
    nominal : (F,) float64
        Power, mean 1.
    x, y : (F,) float64
        Frequencies along the line and along the travel, per coarser pitch.
    """

    ratio: Field
    lags: Field
    free: float
    readings: Field
    nominal: Field
    x: Field
    y: Field

    @classmethod
    def of(cls, noises: Sequence[NoiseModel], nominal: NoiseModel) -> "Spectra":
        """Divide spectra by a smooth nominal one.

        Whole profiles and columns are no noise of the surface: their frequencies are left out.
        """
        pitch = nominal.pitch_y_mm, nominal.pitch_x_mm
        y, x = (
            np.broadcast_to(v, (GRID, GRID))
            for v in np.meshgrid(*(np.fft.fftfreq(GRID) * max(pitch) / p for p in pitch),
                                 indexing="ij")
        )  # fmt: skip
        far = np.hypot(x, y)
        use = (x != 0) & (y != 0) & (far > 1 / WAVELENGTHS[-1]) & (far < 0.5)
        once = use & (y > 0)
        smooth = nominal.acf * np.outer(*(_taper(lag) for lag in nominal.lags))
        power = np.maximum(_power(smooth), SETTINGS.claims.lay_least_power)
        ratio = np.stack([_power(n.acf) / power for n in noises])
        ratio /= ratio[:, use].mean(axis=1)[:, None, None]
        ratio = np.where(use, ratio - 1, 0.0)
        near = _near()
        return cls(
            ratio=ratio[:, once], lags=np.fft.ifft2(ratio).real[:, near].T,
            free=float(near.sum() * use.mean()),
            readings=np.array([max(n.readings, 1) for n in noises], dtype=np.float64),
            nominal=power[once], x=x[once], y=y[once],
        )  # fmt: skip

    def strips(self, angles_rad: Field, width: float) -> Field:
        """Change of the ratio by a strip across each angle, (R, octaves, F).

        Each octave's is a unit of the mean power of all frequencies; it has no part in the level.

        Parameters
        ----------
        angles_rad : (R,) of the lay, from the line towards the travel
        width : standard deviation of the strip, per coarser pitch
        """
        far = -np.log(np.hypot(self.x, self.y))
        octave = np.stack([1 - np.abs(far - math.log(w)) / math.log(2) for w in WAVELENGTHS[1:-1]])
        along = np.cos(angles_rad)[:, None] * self.x + np.sin(angles_rad)[:, None] * self.y
        power = np.maximum(octave, 0) * np.exp(-0.5 * np.square(along / width))[:, None]
        power *= GRID**2 / 2 / np.maximum(power.sum(axis=2, keepdims=True), 1e-12)
        power /= self.nominal
        return np.asarray(power - power.mean(axis=2, keepdims=True))


def products(one: Field, two: Field) -> Field:
    """Mean over all frequencies of products: (..., F) and (..., F) to (..., ...)."""
    return np.asarray(np.tensordot(one, two, axes=(-1, -1)) * 2 / GRID**2)


def _power(acf: Field) -> Field:
    """Spectrum of an autocorrelation, (GRID, GRID); mean 1."""
    ly, lx = acf.shape[0] // 2, acf.shape[1] // 2
    torus = np.zeros((GRID, GRID))
    rows, columns = np.arange(-ly, ly + 1) % GRID, np.arange(-lx, lx + 1) % GRID
    np.add.at(torus, (rows[:, None], columns[None, :]), acf)
    return np.asarray(np.fft.fft2(torus).real)


def _near() -> Mask:
    """Lags as far as `lay_reach`, of two opposite ones one, (GRID, GRID)."""
    lag = np.fft.fftfreq(GRID, 1 / GRID)
    down, right = np.meshgrid(lag, lag, indexing="ij")
    once = (down > 0) | ((down == 0) & (right > 0))
    reach = SETTINGS.claims.lay_reach
    return np.asarray(once & (np.abs(down) <= reach) & (np.abs(right) <= reach))


def _taper(lag: int) -> Field:
    """Window over lags -lag..lag: 1 to half of `lay_smooth`, then down to 0 as a cosine."""
    far = np.abs(np.arange(-lag, lag + 1)) / SETTINGS.claims.lay_smooth
    return np.where(far < 0.5, 1.0, 0.5 * (1 + np.cos(2 * np.pi * (np.clip(far, 0.5, 1) - 0.5))))
