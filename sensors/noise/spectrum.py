"""Power spectra of scans along and across the profiles, and how far two of them differ."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def power_spectrum(heights_mm: Floats, pitch_mm: float, axis: int) -> tuple[Floats, Floats]:
    """Mean one-sided power spectral density along one axis.

    Parameters
    ----------
    heights_mm : (n, m) array
        Heights without form; missing readings count as the line's mean.
    pitch_mm : float
        Distance of the points along `axis`, mm.
    axis : int
        1 along the profiles, 0 across them.

    Returns
    -------
    frequency, density : arrays
        Cycles per mm (without zero) and mm²·mm, averaged over all lines. A Hann window keeps the
        ends from leaking; the density's integral is the variance.
    """
    lines = np.asarray(heights_mm, dtype=np.float64)
    lines = lines if axis in (1, -1) else lines.T
    valid = np.isfinite(lines)
    count = np.maximum(valid.sum(axis=1, keepdims=True), 1)
    mean = np.where(valid, lines, 0.0).sum(axis=1, keepdims=True) / count
    centred = np.where(valid, lines - mean, 0.0)
    n = lines.shape[1]
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(n) + 0.5) / n)
    # the window's loss of power and the missing readings' share
    gain = np.mean(taper**2) * max(float(valid.mean()), 1e-12)
    power = np.mean(np.abs(np.fft.rfft(centred * taper, axis=1)) ** 2, axis=0)
    density = power * 2.0 * pitch_mm / (n * gain)
    frequency = np.arange(1, density.size, dtype=np.float64) / (n * pitch_mm)
    return frequency, np.asarray(density[1:], dtype=np.float64)


def band_edges(low_per_mm: float, high_per_mm: float, points: int, bands: int = 12) -> Floats:
    """Edges of about `bands` bands, evenly spaced in log frequency, none without a line in it.

    Parameters
    ----------
    low_per_mm, high_per_mm : float
        From the form cut-off to the resolution limit, cycles per mm.
    points : int
        Lines between zero and `high_per_mm`.
    """
    width = high_per_mm / max(points, 1)
    edges = [low_per_mm]
    ratio = (high_per_mm / low_per_mm) ** (1.0 / bands)
    while edges[-1] < high_per_mm * (1 - 1e-9):
        edges.append(min(max(edges[-1] * ratio, edges[-1] + 1.5 * width), high_per_mm))
    return np.array(edges)


def band_power(frequency: Floats, density: Floats, edges: Floats) -> Floats:
    """Mean density in each band, NaN where no line falls in."""
    band = np.searchsorted(edges, frequency * (1 + 1e-9), side="right") - 1
    band = np.where(np.isclose(frequency, edges[-1]), edges.size - 2, band)
    inside = (band >= 0) & (band < edges.size - 1)
    total = np.bincount(band[inside], weights=density[inside], minlength=edges.size - 1)
    count = np.bincount(band[inside], minlength=edges.size - 1)
    with np.errstate(invalid="ignore"):
        return np.where(count > 0, total / count, np.nan)


def decibels(density: Floats, reference: Floats) -> Floats:
    """Ratio of two densities in dB."""
    return np.asarray(10.0 * np.log10(density / reference))
