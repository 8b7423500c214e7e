"""Whether the noise is a surface's that went through the firmware's filters.

A filter leaves less noise and a correlation over its window, both by integers; a smoother surface
leaves less noise of the same correlation, a finer or coarser one another correlation. Each
alternative is drawn from the surface's file at the recording's pitch and measured as the recording
was; the one whose spectrum is nearest stands.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fields import Field
from diagnosis.noise.noise_model import NoiseModel, calibrate
from diagnosis.settings import SETTINGS
from sensors.effects.base import Effect
from sensors.effects.onboard_filter import OnboardFilter
from sensors.effects.roughness_level import RoughnessLevel
from sensors.law import geometric_law
from sensors.noise.speckle import Speckle
from sensors.noise.uncertainty import quantise, sigma_mm
from sensors.surface.surface import Surface
from sensors.view.view import View

DRAWN_POINTS = 128
"""Points along either axis of a drawn field: some 16000 readings, whose spectrum is known to
about a tenth in each of the frequencies compared."""
FREQUENCIES = (64, 64)
MEDIANS = (1, 3, 5)
MEANS_ALONG = (1, 3, 5, 7, 9)
MEANS_ACROSS = (1, 3, 5, 7)
"""Windows that makers offer and that leave a scan its shape."""
AMPLITUDES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.12, 0.08)
PEAKS = (0.3, 0.5, 0.7, 1.0, 1.4, 2.0)
"""Factors on heights and on peaks per mm that a surface other than claimed may have."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Claimed:
    """What a surface's file claims of the noise, on a recording's grid."""

    speckle: Speckle
    white_mm: float
    step_mm: float
    pitch_mm: tuple[float, float]

    def noise(self, firmware: OnboardFilter, amplitude: float = 1.0, peaks: float = 1.0) -> Field:
        """Draw readings of a flat, (n, n) mm; the same heights and errors for every filter."""
        rng = np.random.default_rng(0)
        field = replace(
            self.speckle,
            amplitude_mm=self.speckle.amplitude_mm * amplitude,
            cell_x_mm=self.speckle.cell_x_mm / peaks,
            cell_y_mm=self.speckle.cell_y_mm / peaks,
        )
        x_mm, y_mm = (np.arange(DRAWN_POINTS, dtype=np.float64) * p for p in self.pitch_mm)
        drawn = field.sample(x_mm, y_mm, rng)
        drawn = drawn - drawn.mean() + self.white_mm * rng.standard_normal(drawn.shape)
        return quantise(firmware.filtered(quantise(drawn, self.step_mm)), self.step_mm)


def filtered_instead(effect: Effect, own: NoiseModel, surface: Surface, view: View) -> Effect:
    """Put a filter in the place of a surface smoother than its file, where that is nearer.

    Where the sensor's file lists a filter it has been taken into account.
    """
    smooth = isinstance(effect, RoughnessLevel) and effect.amplitude < 1
    listed = any(isinstance(e, OnboardFilter) for e in view.sensor.effects)
    found = onboard_filter_of(own, surface, view) if smooth and not listed else None
    return found or effect


def onboard_filter_of(own: NoiseModel, surface: Surface, view: View) -> OnboardFilter | None:
    """Return the filter that turns the noise of a surface's file into a recording's, if one does.

    Parameters
    ----------
    own : noise of the recordings
    surface, view : what the surface's file claims, and a scan of it
    """
    speckle = geometric_law(view, surface).speckle
    if speckle is None or min(own.lags) < SETTINGS.claims.filter_lags:
        return None
    sheet = view.datasheet
    claimed = _Claimed(
        speckle=speckle, white_mm=sigma_mm(sheet), step_mm=sheet.step_mm,
        pitch_mm=(own.pitch_x_mm, own.pitch_y_mm),
    )  # fmt: skip
    none = OnboardFilter.none()
    surfaces = itertools.product((none,), AMPLITUDES, PEAKS)
    nearest = min(_divergence(own, claimed.noise(*each), claimed) for each in surfaces)
    filters = [(_divergence(own, claimed.noise(each), claimed), each) for each in _filters()]
    distance, best = min(filters, key=lambda pair: pair[0])
    most = min(SETTINGS.claims.filter_nats, SETTINGS.claims.filter_share * nearest)
    return best if distance < most else None


def _filters() -> Iterator[OnboardFilter]:
    none = OnboardFilter.none()
    for a, b, c, d in itertools.product(MEDIANS, MEDIANS, MEANS_ACROSS, MEANS_ALONG):
        if (a, b, c, d) != (1, 1, 1, 1):
            yield none.with_parameters(
                median_profiles=a, median_points=b, mean_profiles=c, mean_points=d
            )


def _divergence(own: NoiseModel, drawn_mm: Field, claimed: _Claimed) -> float:
    """Kullback-Leibler divergence of two stationary Gaussian fields, nats per reading.

    ½ mean over frequencies of r - 1 - ln r, r the ratio of the spectra (Whittle, Ark. Mat. 2
    (1953) 423); rounding is the floor of both.
    """
    other = calibrate(
        [drawn_mm], [np.ones(drawn_mm.shape, dtype=bool)], pitch_mm=claimed.pitch_mm,
        missing_share=0.0, from_reference=False,
    )  # fmt: skip
    reach = [min(a, b) for a, b in zip(own.lags, other.lags, strict=True)]
    floor = max(claimed.step_mm**2 / 12, 1e-4 * own.sd_mm**2)
    ratio = _spectrum(own, reach, floor) / _spectrum(other, reach, floor)
    return float(0.5 * np.mean(ratio - 1 - np.log(ratio)))


def _spectrum(noise: NoiseModel, reach: list[int], floor_mm2: float) -> Field:
    ly, lx = noise.lags
    cut = np.s_[ly - reach[0] : ly + reach[0] + 1, lx - reach[1] : lx + reach[1] + 1]
    power = replace(noise, acf=noise.acf[cut]).spectrum(FREQUENCIES)
    return np.asarray(np.maximum(power, 0.0) * noise.sd_mm**2 + floor_mm2)
