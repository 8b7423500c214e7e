"""Spectra of a part's noise over a nominal one, and strips of waves in them.

Ridges with one direction on the part are waves across them: a strip of the spectrum through its
middle, narrow along the ridges. How much power a recording has at each wavelength whatever the
direction is no sign of ridges: a rougher finish has more of the long waves. What it has beyond the
nominal noise, as its mean over directions, is added to that; and by Whittle's likelihood the power
of a wave is as uncertain as it is large.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    """Spectra over what they are without ridges, less 1.

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
    level : (R, F) float64
        Power that the ratio is to, mean 1.
    x, y : (F,) float64
        Frequencies along the line and along the travel, per coarser pitch.
    rings : (F,) int64
        Which frequencies are of one wavelength.
    """

    ratio: Field
    lags: Field
    free: float
    readings: Field
    level: Field
    x: Field
    y: Field
    rings: NDArray[np.int64]

    @classmethod
    def of(cls, noises: Sequence[NoiseModel], nominal: NoiseModel) -> "Spectra":
        """Divide spectra by a smooth nominal one and by what a finish adds to it.

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
        power = np.maximum(power_of(smooth), SETTINGS.claims.lay_least_power)
        octaves = np.log2(np.maximum(far, 1e-9) / 0.5)
        ring = np.floor(SETTINGS.claims.lay_rings * octaves).astype(np.int64)
        ring -= ring[use].min()
        own = np.stack([power_of(n.acf)[use] for n in noises])
        level = np.stack([_evened(one, power[use], ring[use]) for one in own])
        level /= level.mean(axis=1, keepdims=True)
        own /= level
        ratio = np.zeros((len(noises), GRID, GRID))
        ratio[:, use] = own / _over_rings(own, ring[use]) - 1
        near, half = _near(), once[use]
        return cls(
            ratio=ratio[:, once], lags=np.fft.ifft2(ratio).real[:, near].T,
            free=near.sum() * use.mean() - _in_rings(np.where(use, ring, -1), near),
            readings=np.array([max(n.readings, 1) for n in noises], dtype=np.float64),
            level=level[:, half], x=x[once], y=y[once], rings=ring[once],
        )  # fmt: skip

    def strips(self, angles_rad: Field, width: float) -> Field:
        """Change of the ratio by a strip across each angle, (R, octaves, F).

        Each octave's is a unit of the mean power of all frequencies; it has no part in the means
        over directions.

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
        power /= self.level[: len(power), None]
        return np.asarray(power - _over_rings(power, self.rings))


def products(one: Field, two: Field) -> Field:
    """Mean over all frequencies of products: (..., F) and (..., F) to (..., ...)."""
    return np.asarray(np.tensordot(one, two, axes=(-1, -1)) * 2 / GRID**2)


def power_of(acf: Field) -> Field:
    """Spectrum of an autocorrelation, (GRID, GRID); mean 1."""
    ly, lx = acf.shape[0] // 2, acf.shape[1] // 2
    torus = np.zeros((GRID, GRID))
    rows, columns = np.arange(-ly, ly + 1) % GRID, np.arange(-lx, lx + 1) % GRID
    np.add.at(torus, (rows[:, None], columns[None, :]), acf)
    return np.asarray(np.fft.fft2(torus).real)


def _over_rings(values: Field, ring: NDArray[np.int64]) -> Field:
    """Replace values (..., F) by their means over frequencies of one ring."""
    flat = values.reshape(-1, values.shape[-1])
    number = np.maximum(np.bincount(ring), 1)
    means = np.stack([np.bincount(ring, v, number.size) / number for v in flat])
    return np.asarray(means[:, ring].reshape(values.shape))


def _evened(power: Field, nominal: Field, ring: NDArray[np.int64]) -> Field:
    """Power (F,) without ridges: as much of the nominal one as each wavelength has, and a finish's.

    That is the same in all directions.
    """
    own, usual = _over_rings(power, ring), _over_rings(nominal, ring)
    octave = (ring.max() - ring) // SETTINGS.claims.lay_rings
    share = max(float((_over_rings(power, octave) / _over_rings(nominal, octave)).min()), 0.0)
    return np.maximum(own + share * (nominal - usual), SETTINGS.claims.lay_least_power)


def _in_rings(ring: NDArray[np.int64], near: Mask) -> float:
    """How many independent autocorrelations at near lags the means over rings take.

    A spectrum's two halves are one: twice the share that a ring's mean has at these lags.
    """
    found = 0.0
    for k in range(int(ring.max()) + 1):
        its = ring == k
        if its.any():
            lags = np.fft.ifft2(its / math.sqrt(its.sum())).real * GRID
            found += 2 * float(np.square(lags[near]).sum())
    return found


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
