"""Noise calibration: how large the readings' noise is, how it is correlated, how long its tails.

Neighbouring readings share speckle, so p-values and predictive densities need the noise's
correlation, not only its size. It is measured as an anisotropic 2-D autocovariance from plates or
from the recordings' own residuals; its Fourier transform is the spectrum (Wiener-Khinchin).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import uniform_filter

from diagnosis.fields import Field, Mask, median_sd
from diagnosis.settings import SETTINGS

MAX_LAG = 24
LAG_PART = 4
"""Lags reach over a quarter of a field: a recording of fewer profiles than 4 has none at all."""
M_BEND, M_SHARE, M_STEPS, M_SETTLED, M_VALUES = 1.5476, 0.5, 50, 1e-4, 100_000
"""Of the M-estimator of scale: bend, mean of ρ, most iterations, change of the scale's square that
ends them, and values that are looked at."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False, weakref_slot=True)
class NoiseModel:
    """Stationary Gaussian noise with tails.

    Attributes
    ----------
    sd_mm : float
        Standard deviation of a reading's noise, tails apart, mm.
    acf : (2 ly + 1, 2 lx + 1) float64
        Autocorrelation at lags -ly..ly rows and -lx..lx columns, 1 at the centre; the Fourier
        transform of a spectrum that is nowhere negative.
    tail_share, tail_sd_mm : float
        Share of readings beyond `noise.clip_sd`, mm size of those; Gaussian noise has next to none.
    missing_share : float
        Share of readings lost for no geometric reason.
    pitch_x_mm, pitch_y_mm : float
        Pitches at which the lags hold.
    readings : int
        How many readings it was measured from.
    innovation_sd : float
        Measured size of the whitened readings over the predicted one.
    long_waves : float
        Power that the long waves of whitened readings have, 1 or more.
    """

    sd_mm: float
    acf: Field
    tail_share: float
    tail_sd_mm: float
    missing_share: float
    pitch_x_mm: float
    pitch_y_mm: float
    readings: int
    innovation_sd: float = 1.0
    long_waves: float = 1.0

    @property
    def lags(self) -> tuple[int, int]:
        """Largest lag in rows and in columns."""
        return self.acf.shape[0] // 2, self.acf.shape[1] // 2

    def correlation_length_px(self) -> tuple[float, float]:
        """Integral correlation length along rows' direction y and columns' direction x, pixels."""
        ly, lx = self.lags
        return (
            float(np.clip(self.acf[:, lx], 0, None).sum()),
            float(np.clip(self.acf[ly], 0, None).sum()),
        )

    def rounded(self, step_mm: float) -> "NoiseModel":
        """Add the error of counting in steps: white, of the variance step²/12."""
        power = self.sd_mm**2 + step_mm**2 / 12
        acf = self.acf * self.sd_mm**2
        acf[self.lags] += step_mm**2 / 12
        return replace(self, sd_mm=float(np.sqrt(power)), acf=acf / power)

    def at_pitch(self, pitch_x_mm: float, pitch_y_mm: float) -> "NoiseModel":
        """Rescale the lags to another pitch; about the same one is left alone."""
        ratio_x, ratio_y = pitch_x_mm / self.pitch_x_mm, pitch_y_mm / self.pitch_y_mm
        if max(abs(np.log(ratio_x)), abs(np.log(ratio_y))) < SETTINGS.noise.same_pitch:
            return self

        ly, lx = self.lags
        grid = RegularGridInterpolator(
            (np.arange(-ly, ly + 1), np.arange(-lx, lx + 1)),
            self.acf,
            bounds_error=False,
            fill_value=0.0,
        )
        rows, columns = np.meshgrid(
            np.arange(-ly, ly + 1) * ratio_y, np.arange(-lx, lx + 1) * ratio_x, indexing="ij"
        )
        acf = _nonnegative(grid(np.stack([rows, columns], axis=-1)))
        return replace(self, acf=acf, pitch_x_mm=pitch_x_mm, pitch_y_mm=pitch_y_mm)

    def spectrum(self, shape: tuple[int, int]) -> Field:
        """Power per discrete frequency on a torus that holds `shape` and the lags; mean 1."""
        ly, lx = self.lags
        size = (_fast(shape[0] + ly), _fast(shape[1] + lx))
        torus = np.zeros(size)
        rows = np.arange(-ly, ly + 1) % size[0]
        columns = np.arange(-lx, lx + 1) % size[1]
        np.add.at(torus, (rows[:, None], columns[None, :]), self.acf)
        return np.asarray(np.fft.fft2(torus).real)


def calibrate(
    residuals_mm: Sequence[Field],
    valid: Sequence[Mask],
    *,
    pitch_mm: tuple[float, float],
    missing_share: float,
) -> NoiseModel:
    """Measure the noise of residual fields, robustly against smooth misfit and spikes.

    Row and column means and a local mean are taken off first: what is smooth or whole-row or
    whole-column belongs to the tests, not to the noise.

    Parameters
    ----------
    residuals_mm : sequence of (n, m)
        Reading minus plain model, mm.
    valid : sequence of (n, m) bool
        Which to use: no edges, no missing.
    pitch_mm : (x, y)
        Pitches of the fields, mm.
    """
    shapes = [r.shape for r in residuals_mm]
    ly = int(min(MAX_LAG, min(s[0] for s in shapes) // LAG_PART))
    lx = int(min(MAX_LAG, min(s[1] for s in shapes) // LAG_PART))
    total = np.zeros((2 * ly + 1, 2 * lx + 1))
    pairs = np.zeros_like(total)
    values: list[Field] = []
    beyond: list[Field] = []
    sizes = [high_pass(r, v) for r, v in zip(residuals_mm, valid, strict=True)]
    used_all = np.concatenate([f[u] for f, u in sizes]) if sizes else np.zeros(0)
    scale = robust_sd(used_all)
    for field, used in sizes:
        near = used & (np.abs(field) < SETTINGS.noise.clip_sd * scale)
        a, b = _covariance(field, near, ly, lx)
        total += a
        pairs += b
        values.append(field[near])
        beyond.append(field[used & ~near])
    inside = np.concatenate(values)
    outside = np.concatenate(beyond)
    if inside.size < SETTINGS.noise.least_readings:
        return NoiseModel(
            sd_mm=max(scale, 1e-4),
            acf=np.ones((1, 1)),
            tail_share=0.0,
            tail_sd_mm=SETTINGS.noise.tail_sd * max(scale, 1e-4),
            missing_share=missing_share,
            pitch_x_mm=pitch_mm[0],
            pitch_y_mm=pitch_mm[1],
            readings=int(inside.size),
        )
    covariance = np.where(pairs > SETTINGS.noise.least_pairs, total / np.maximum(pairs, 1), 0.0)
    # the means taken off leave a small negative floor: the far lags show it
    ring = np.ones_like(covariance, dtype=bool)
    ring[ly - ly // 2 : ly + ly // 2 + 1, lx - lx // 2 : lx + lx // 2 + 1] = False
    if ring.any():
        covariance = covariance - np.median(covariance[ring])
    variance = max(covariance[ly, lx], 1e-12)
    acf = covariance / variance
    # tapered to zero at the ends
    taper = np.outer(_taper(ly), _taper(lx))
    acf = _nonnegative(acf * taper)
    tail_mm = np.sqrt(np.mean(outside**2)) if outside.size else 0.0
    return NoiseModel(
        sd_mm=float(np.sqrt(variance)),
        acf=acf,
        tail_share=float(outside.size / max(outside.size + inside.size, 1)),
        tail_sd_mm=float(max(tail_mm, SETTINGS.noise.least_tail_sd * scale)),
        missing_share=missing_share,
        pitch_x_mm=pitch_mm[0],
        pitch_y_mm=pitch_mm[1],
        readings=int(inside.size),
    )


def high_pass(field: Field, valid: Mask, width: int = 41) -> tuple[Field, Mask]:
    """Take a local mean, then row and column medians off a field; spikes are cut first."""
    used = valid & np.isfinite(field)
    if not used.any():
        return np.zeros_like(field), used
    clean = np.where(used, field, 0.0)
    window = (min(width, field.shape[0] // 3 * 2 + 1), min(width, field.shape[1] // 3 * 2 + 1))
    for _ in range(3):
        middle = local_mean(clean, used, window)
        rest = np.where(used, field - middle, np.nan)
        scale = robust_sd(rest[used])
        spikes = used & (np.abs(rest) > SETTINGS.noise.clip_sd * scale)
        clean = np.where(spikes, middle + np.clip(rest, -scale, scale), np.where(used, field, 0.0))
    rest = np.where(used, field - middle, np.nan)
    clipped = np.clip(rest, -3 * scale, 3 * scale)
    for axis in (1, 0):
        count = used.sum(axis=axis, keepdims=True)
        mean = np.nansum(clipped, axis=axis, keepdims=True) / np.maximum(count, 1)
        rest, clipped = rest - mean, clipped - mean
    return np.where(used, rest, 0.0), used


def local_mean(field: Field, used: Mask, window: tuple[int, int]) -> Field:
    """Mean of the used readings in a window around each point, (n, m)."""
    weight = uniform_filter(used.astype(np.float64), window, mode="constant")
    total = uniform_filter(np.where(used, field, 0.0), window, mode="constant")
    return np.asarray(total / np.maximum(weight, 1e-9))


def _covariance(field: Field, used: Mask, ly: int, lx: int) -> tuple[Field, Field]:
    """Sum of products and number of pairs at each lag, by FFT over the used readings."""
    size = (_fast(field.shape[0] + ly), _fast(field.shape[1] + lx))
    one = np.fft.rfft2(used.astype(np.float64), s=size)
    value = np.fft.rfft2(np.where(used, field, 0.0), s=size)
    rows = np.arange(-ly, ly + 1) % size[0]
    columns = np.arange(-lx, lx + 1) % size[1]
    pick = (rows[:, None], columns[None, :])
    products = np.fft.irfft2(np.abs(value) ** 2, s=size)[pick]
    return products, np.round(np.fft.irfft2(np.abs(one) ** 2, s=size)[pick])


def _nonnegative(acf: Field) -> Field:
    """Nearest autocorrelation with a spectrum that is nowhere negative; 1 at the centre."""
    ly, lx = acf.shape[0] // 2, acf.shape[1] // 2
    size = (_fast(4 * ly + 2), _fast(4 * lx + 2))
    torus = np.zeros(size)
    rows = np.arange(-ly, ly + 1) % size[0]
    columns = np.arange(-lx, lx + 1) % size[1]
    np.add.at(torus, (rows[:, None], columns[None, :]), acf)
    power = np.clip(np.fft.fft2(torus).real, 2e-3 * max(acf[ly, lx], 1e-12), None)
    back = np.fft.ifft2(power).real[np.ix_(rows, columns)]
    return np.asarray(back / back[ly, lx])


def _taper(lag: int) -> Field:
    distance = np.abs(np.arange(-lag, lag + 1)) / max(lag, 1)
    return np.where(distance < 0.5, 1.0, 0.5 * (1 + np.cos(2 * np.pi * (distance - 0.5))))


def robust_sd(values: Field) -> float:
    """Return a standard deviation that some outliers don't move, 0 of no values.

    The M-estimator of scale s with mean ρ(r/s) = 1/2, ρ Tukey's bisquare with its bend at 1.5476:
    up to half of the values may lie anywhere (Maronna et al., Robust Statistics, 2006, § 2.5).
    Unlike a median it is no step of a lattice where readings are counts as coarse as their noise.
    """
    if values.size == 0:
        return 0.0
    values = values.ravel()[:: max(1, values.size // M_VALUES)]
    away = values - np.median(values)
    start = median_sd(away)
    away = np.square(away)
    square = max(start, 0.1 * float(np.sqrt(away.mean()))) ** 2
    if square == 0.0:
        return 0.0
    for _ in range(M_STEPS):
        inner = 1.0 - np.minimum(away / (M_BEND**2 * square), 1.0)
        ratio = float(1.0 - np.mean(inner**3)) / M_SHARE
        square *= ratio
        if abs(ratio - 1.0) < M_SETTLED:
            break
    return float(np.sqrt(square))


def _fast(size: int) -> int:
    from scipy.fft import next_fast_len

    return int(next_fast_len(size, real=True))
