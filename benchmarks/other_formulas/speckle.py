"""Correlated noise of a recording: drawn, and its exact covariance for signals that it hides.

A field is white noise convolved with a small kernel of unit energy. Its covariance is the kernel's
autocorrelation, so that nothing is estimated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.signal import fftconvolve

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Noise:
    """Stationary noise of unit variance: `share` of it speckle, the rest independent.

    Attributes
    ----------
    kernel : (a, b) odd sizes, sum of squares 1
    share : of the variance
    """

    kernel: Floats
    share: float

    def draw(self, shape: tuple[int, int], rng: np.random.Generator) -> Floats:
        """Draw a field (n, m) of unit variance."""
        return np.sqrt(self.share) * field(self.kernel, shape, rng) + np.sqrt(
            1 - self.share
        ) * rng.standard_normal(shape)

    @property
    def autocorrelation(self) -> Floats:
        """Autocorrelation of the speckle alone, zero lag in the middle."""
        return np.asarray(fftconvolve(self.kernel, self.kernel[::-1, ::-1]))

    def spectrum(self, shape: tuple[int, int]) -> Floats:
        """Power of each frequency on a periodic grid, mean 1."""
        power = np.abs(np.fft.fft2(self.kernel, shape)) ** 2
        return np.asarray(self.share * power + 1 - self.share)


def field(kernel: Floats, shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    """White noise convolved with a kernel of unit energy, (n, m)."""
    wide = tuple(n + k - 1 for n, k in zip(shape, kernel.shape, strict=True))
    return np.asarray(fftconvolve(rng.standard_normal(wide), kernel, mode="valid"))


def unit(kernel: Floats) -> Floats:
    """Scale a kernel to unit energy."""
    return np.asarray(kernel / np.sqrt((kernel**2).sum()))


def speckle_kernel(
    across: float,
    negative: float,
    *,
    ratio: float = 1.0,
    angle_rad: float = 0.0,
    pitches: tuple[float, float] = (1.0, 1.0),
) -> Floats:
    """Kernel of speckle: Gaussian along the line, negative lobes along the travel.

    Goodman, Speckle Phenomena in Optics, chapter 4, gives the lobe along the line; the window of
    the line moving over fixed scatterers correlates neighbouring profiles negatively.

    Parameters
    ----------
    across : standard deviation along the line, readings
    negative : size of the lobes in the neighbouring profiles, 0 to 0.5
    ratio, angle_rad : a lay's stretch along a direction, from columns towards profiles
    pitches : of columns and profiles, in the unit of a lay's width
    """
    half = 4 + int(2 * ratio)
    v, u = np.mgrid[-half : half + 1, -half : half + 1].astype(float)
    if ratio == 1.0:
        lobes = np.where(v == 0, 1.0, np.where(np.abs(v) == 1, -negative, 0.0))
        return unit(np.exp(-0.5 * (u / across) ** 2) * lobes)
    u, v = u * pitches[0], v * pitches[1]
    along = u * np.cos(angle_rad) + v * np.sin(angle_rad)
    aside = v * np.cos(angle_rad) - u * np.sin(angle_rad)
    long, short = across * np.sqrt(ratio), across / np.sqrt(ratio)
    return unit(np.exp(-0.5 * ((along / long) ** 2 + (aside / short) ** 2)))


class Covariance:
    """The covariance of unit noise at some readings of a grid, applied without a matrix."""

    def __init__(self, noise: Noise, use: NDArray[np.bool_]) -> None:
        self.use, self.share = use, noise.share
        lags = noise.autocorrelation
        size = [next_fast_len(n + k) for n, k in zip(use.shape, lags.shape, strict=True)]
        wrapped = np.zeros(size)
        wrapped[: lags.shape[0], : lags.shape[1]] = lags
        wrapped = np.roll(wrapped, [-(k // 2) for k in lags.shape], (0, 1))
        self._size, self._power = size, rfft2(wrapped).real

    def times(self, v: Floats) -> Floats:
        """Covariance times a vector over the used readings."""
        grid = np.zeros(self._size)
        n, m = self.use.shape
        grid[:n, :m][self.use] = v
        full = irfft2(rfft2(grid) * self._power, s=self._size)[:n, :m]
        return np.asarray(self.share * full[self.use] + (1 - self.share) * v)

    def solve(self, v: Floats, tolerance: float = 1e-3) -> Floats:
        """Covariance⁻¹ v by conjugate gradients (Hestenes and Stiefel 1952)."""
        x, rest = np.zeros_like(v), v.copy()
        way, size = rest.copy(), float(rest @ rest)
        goal = tolerance**2 * size
        for _ in range(200):
            if size <= goal or size == 0.0:
                break
            moved = self.times(way)
            step = size / float(way @ moved)
            x, rest = x + step * way, rest - step * moved
            last, size = size, float(rest @ rest)
            way = rest + size / last * way
        return x
