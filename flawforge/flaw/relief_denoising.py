"""Denoising of a relief by the noise's own spectrum: the posterior mean of a Gaussian process."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse.linalg import LinearOperator, cg

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SMOOTHNESS = 1.5
"""ν of the prior's Matérn covariance: once differentiable, as dents, grooves and pile-ups are but
for their edges (Stein, Interpolation of Spatial Data, 1999: smoother priors smooth too much)."""
TOLERANCE = 1e-4
"""Relative residual of the equations; a hundredth of the noise where the flaw is a hundred times
as large."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Denoised:
    """Denoised heights.

    Attributes
    ----------
    height_mm : (n, m) float64
        Posterior mean, also where no reading is.
    sd_mm : float
        Posterior standard deviation, averaged over the field.
    length_mm, size_mm : float
        Length scale and standard deviation of the prior, estimated from the heights.
    """

    height_mm: Floats
    sd_mm: float
    length_mm: float
    size_mm: float


def denoise(
    height_mm: Floats,
    noise_power: Floats,
    pitch_mm: tuple[float, float],
    where: Bools,
) -> Denoised:
    """Estimate the surface below noisy heights.

    The heights are surface plus noise, both stationary Gaussian. The surface's covariance is
    Matérn's with spectrum

        S(f) ∝ (2ν / l² + 4π² f²)^-(ν + 1)

    (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, equation 4.15, in two
    dimensions). Its size and length l maximise Whittle's likelihood (Arkiv för Matematik 2 (1953)
    423) of the heights' periodogram, in the places `where`, given the noise's spectrum. The
    estimate is the posterior mean S (S + N)^-1 y over the readings that there are (their equation
    2.25), which is Wiener's filter where none is missing. S and N are circulant on a torus with
    room for the lags, so that the equations are solved by conjugate gradients with Fourier
    transforms.

    Parameters
    ----------
    height_mm
        (n, m) heights over the nominal surface, NaN where missing.
    noise_power
        (r, c), r >= n and c >= m: power of the noise at the frequencies of a torus of that size,
        mm²; its mean is the noise's variance.
    pitch_mm
        Distance of rows and of columns.
    where
        (n, m) places whose heights are typical of the surface that is wanted.
    """
    seen = np.isfinite(height_mm)
    n, m = height_mm.shape
    torus = noise_power.shape
    values = np.zeros(torus)
    values[:n, :m] = np.where(seen, height_mm, 0.0)
    there = np.zeros(torus, np.bool_)
    there[:n, :m] = seen
    frequency = np.hypot(
        np.fft.fftfreq(torus[0], pitch_mm[0])[:, None], np.fft.fftfreq(torus[1], pitch_mm[1])
    )
    typical = np.zeros(torus, np.bool_)
    typical[:n, :m] = where & seen
    periodogram = np.abs(np.fft.fft2(np.where(typical, values, 0.0))) ** 2 / typical.sum()
    variance = float(np.mean(values[typical] ** 2))
    size, length = _prior(periodogram, noise_power, frequency, variance, pitch_mm)
    prior = _matern(frequency, size, length)
    both = prior + noise_power

    def covariance(vector: Floats) -> Floats:
        field = np.zeros(torus)
        field[there] = vector
        return np.asarray(np.fft.ifft2(np.fft.fft2(field) * both).real[there])

    count = int(there.sum())
    operator = LinearOperator((count, count), matvec=covariance, dtype=np.float64)
    weight, _ = cg(operator, values[there], rtol=TOLERANCE, maxiter=500)
    field = np.zeros(torus)
    field[there] = weight
    smooth = np.fft.ifft2(np.fft.fft2(field) * prior).real[:n, :m]
    return Denoised(
        height_mm=np.asarray(smooth),
        sd_mm=float(np.sqrt(np.mean(prior * noise_power / both))),
        length_mm=length,
        size_mm=size,
    )


def _matern(frequency: Floats, size_mm: float, length_mm: float) -> Floats:
    """Return the prior's power at frequencies of a torus; its mean is `size_mm` squared."""
    shape = (2 * SMOOTHNESS / length_mm**2 + (2 * np.pi * frequency) ** 2) ** -(SMOOTHNESS + 1)
    return np.asarray(size_mm**2 * shape / shape.mean())


def _prior(
    periodogram: Floats, noise: Floats, frequency: Floats, variance: float, pitch: tuple[float, ...]
) -> tuple[float, float]:
    """Return the prior's size and length of greatest likelihood."""

    def cost(logs: Floats) -> float:
        power = _matern(frequency, *np.exp(np.clip(logs, -20.0, 20.0))) + noise
        return float(np.mean(np.log(power) + periodogram / power))

    reach = float(np.sqrt(periodogram.size)) * max(pitch)
    start = np.log([np.sqrt(max(variance, 1e-12)), reach / 10])
    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 0.01, "fatol": 1e-6})
    size, length = np.exp(np.clip(found.x, -20.0, 20.0))
    return float(size), float(np.clip(length, min(pitch), 10 * reach))
