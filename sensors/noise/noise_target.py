"""What is wanted of a scan's noise, taken from a recording, and a simulated window of it.

The window is a flat part's: noise, the sensor's uncertainty (equation 10) and rounding.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sensors.noise.speckle import Speckle
from sensors.noise.spectrum import band_edges, band_power, power_spectrum
from sensors.noise.uncertainty import gaussian_sd_mm, quantise
from sensors.surface.form import remove_form
from sensors.surface.roughness import FIGURES, Roughness, roughness

Floats = NDArray[np.float64]

QUANTILES = np.array([0.01, 0.03, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 0.99])
"""Shares at which the heights of a recording are aimed at."""

FEWEST_PROFILES = 16
"""Scans of fewer profiles have no spectrum across."""


@dataclass(frozen=True, kw_only=True, slots=True)
class NoiseTarget:
    """What is wanted of a scan: figures, and for a recording its spectra and heights as well.

    Parameters
    ----------
    ra_mm, rq_mm, rp_mm, rv_mm, rpm_mm, rvm_mm, pc_per_mm : float, optional
        Wanted figures (`sensors.surface.roughness.Roughness`), any part of them.
    pitch_x_mm, pitch_y_mm : float
        Distance of points and profiles, mm.
    profiles, points : int
        Size of the window in which the figures hold.
    resolution_mm, repeatability_mm : float
        The sensor's ΔZ and σ_rep.
    cutoff_mm : float, optional
        Cut-off of the Gaussian filter with which the figures were taken.
    quantiles_mm, spectrum_along, spectrum_across : tuples, optional
        Of a recording: heights at `QUANTILES` and mean densities in the bands of `bands`.
    """

    pitch_x_mm: float
    pitch_y_mm: float
    ra_mm: float | None = None
    rq_mm: float | None = None
    rp_mm: float | None = None
    rv_mm: float | None = None
    rpm_mm: float | None = None
    rvm_mm: float | None = None
    pc_per_mm: float | None = None
    profiles: int = 100
    points: int = 501
    resolution_mm: float = 0.0038
    repeatability_mm: float = 0.0
    cutoff_mm: float | None = None
    quantiles_mm: tuple[float, ...] | None = field(default=None, repr=False)
    spectrum_along: tuple[float, ...] | None = field(default=None, repr=False)
    spectrum_across: tuple[float, ...] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name, value in self.figures().items():
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} must be positive, not {value:g}")
        if self.pc_per_mm is not None and self.pc_per_mm * self.pitch_x_mm > 0.5:
            raise ValueError(
                f"pc_per_mm {self.pc_per_mm:g} is more than there is room for at a pitch of "
                f"{self.pitch_x_mm:g} mm (a peak at every second point)"
            )

    def figures(self) -> dict[str, float]:
        """Return the figures that are given, by name, in the order of the paper's tables."""
        values = {name: getattr(self, name) for name in FIGURES}
        return {name: float(value) for name, value in values.items() if value is not None}

    def grid(self) -> tuple[Floats, Floats]:
        """Return positions of the window's points and profiles, mm."""
        return (
            np.arange(self.points, dtype=np.float64) * self.pitch_x_mm,
            np.arange(self.profiles, dtype=np.float64) * self.pitch_y_mm,
        )

    def bands(self) -> tuple[Floats, Floats]:
        """Return edges of the bands along and across, from form cut-off to resolution limit."""
        lowest = 1.0 / self.cutoff_mm if self.cutoff_mm else 0.0
        along = max(lowest, 3.0 / (self.points * self.pitch_x_mm))
        across = max(lowest, 3.0 / (self.profiles * self.pitch_y_mm))
        return (
            band_edges(along, 0.5 / self.pitch_x_mm, self.points // 2),
            band_edges(across, 0.5 / self.pitch_y_mm, self.profiles // 2),
        )


def measure(
    heights_mm: Floats,
    pitch_x_mm: float,
    pitch_y_mm: float,
    *,
    resolution_mm: float,
    repeatability_mm: float = 0.0,
    cutoff_mm: float | None = None,
    form: str = "line",
) -> NoiseTarget:
    """Take from a recording (form still in it) all that `calibrate` can aim at.

    Parameters
    ----------
    heights_mm : (n, m) array
        Readings, one row a profile, NaN where missing.

    Raises
    ------
    ValueError
        Where no profile has enough points.
    """
    flat = remove_form(heights_mm, pitch_x_mm, cutoff_mm, form)
    figures = roughness(flat, pitch_x_mm)
    wanted = NoiseTarget(
        **{name: getattr(figures, name) for name in FIGURES},
        pitch_x_mm=pitch_x_mm,
        pitch_y_mm=pitch_y_mm,
        profiles=flat.shape[0],
        points=flat.shape[1],
        resolution_mm=resolution_mm,
        repeatability_mm=repeatability_mm,
        cutoff_mm=cutoff_mm,
    )
    quantiles, along, across = distribution(wanted, flat)
    return replace(
        wanted,
        quantiles_mm=tuple(quantiles.tolist()),
        spectrum_along=tuple(along.tolist()),
        spectrum_across=tuple(across.tolist()) if across.size else None,
    )


def distribution(wanted: NoiseTarget, flat: Floats) -> tuple[Floats, Floats, Floats]:
    """Return heights at `QUANTILES`, densities in the bands along and (rows given) across."""
    along, across = wanted.bands()
    valid = flat[np.isfinite(flat)]
    quantiles = np.quantile(valid - valid.mean(), QUANTILES)
    frequency, density = power_spectrum(flat, wanted.pitch_x_mm, 1)
    power_along = band_power(frequency, density, along)
    if flat.shape[0] < FEWEST_PROFILES:
        return quantiles, power_along, np.empty(0)
    frequency, density = power_spectrum(flat, wanted.pitch_y_mm, 0)
    return quantiles, power_along, band_power(frequency, density, across)


def simulate(
    noise: Speckle,
    wanted: NoiseTarget,
    rng_field: np.random.Generator,
    rng_sensor: np.random.Generator,
    depth_mm: Floats | float = 0.0,
) -> Floats:
    """Draw one window as the sensor would deliver it of a flat part: noise, equation 10, rounding.

    Parameters
    ----------
    noise : Speckle
        The surface's speckle.
    wanted : NoiseTarget
        Window, pitch and sensor.
    rng_field, rng_sensor : Generator
        Sources of the speckle and of the sensor's own uncertainty.
    depth_mm : float or array that broadcasts to (profiles, points)
        Depth of the part.

    Returns
    -------
    (profiles, points) array
        Readings in mm, relative to the part.
    """
    readings = noise.sample(*wanted.grid(), rng_field) + depth_mm
    sigma = gaussian_sd_mm(wanted.resolution_mm, wanted.repeatability_mm)
    return quantise(readings + rng_sensor.normal(0.0, sigma, readings.shape), wanted.resolution_mm)


def simulated_figures(
    noise: Speckle, wanted: NoiseTarget, form_mm: Floats, windows: int = 5
) -> Roughness:
    """Return the mean figures of simulated recordings of a plate.

    Parameters
    ----------
    form_mm : (profiles, points) array
        What was removed from the plate's readings, NaN where missing: rounding depends on it.
    """
    rows = []
    for k in range(windows):
        rngs = np.random.default_rng([7, 2, k]), np.random.default_rng([7, 3, k])
        readings = simulate(noise, wanted, *rngs, depth_mm=form_mm)
        flat = remove_form(readings, wanted.pitch_x_mm, wanted.cutoff_mm)
        rows.append(roughness(flat, wanted.pitch_x_mm).values())
    means = np.mean(rows, axis=0)
    return Roughness(**{name: float(v) for name, v in zip(FIGURES, means, strict=True)})
