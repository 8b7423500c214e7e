"""Detectability of each flaw in a scan: a matched filter against the scan's noise.

The filter weighs each reading of the flaw's footprint by its deviation over its variance. Its
output's mean over its own standard deviation, correlation of the noise included, is the
signal-to-noise ratio (Turin, IRE Trans. Inf. Theory 6 (1960) 311, for white noise the best there
is; correlated noise isn't whitened, since a detector would have to know its spectrum).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2

from pipeline.scan.labels import boxes_of
from sensors.law import Law, smoothed
from sensors.noise.correlation import speckle_kernel
from sensors.noise.perlin import grid_pitch
from sensors.view.view import Reason, View

Floats = NDArray[np.float64]
LEAST_SD_MM = 1e-9  # noise of a sensor without any; as in `pipeline.scan.labels`


@dataclass(frozen=True, kw_only=True, slots=True)
class Evidence:
    """Signal-to-noise ratio and response of one flaw in one scan.

    Attributes
    ----------
    snr : float
        Mean output of the matched filter over its standard deviation. Returns that the flaw took
        or gave count by the log likelihood of their loss on the unflawed surface.
    response : float
        `snr` plus the same filter's noise on these readings: normal about `snr` with standard
        deviation 1, or `snr` itself where the flaw shows by its lost returns alone.
    deviation_max_mm : float
        Largest deviation of the noise-free depth from the unflawed part's, mm; 0 where no point
        returns on both.
    rows, columns : (first, last)
        Profiles and points that the flaw covers, half-open.
    """

    snr: float
    response: float
    deviation_max_mm: float
    rows: tuple[int, int]
    columns: tuple[int, int]


class MatchedFilter:
    """The noise of one scan, for the matched filter of each flaw.

    Parameters
    ----------
    law, view
        Predicted readings of the flawed part, and the scan they belong to.
    reading_mm, clean_mm : (n, m)
        What was read, and the noise-free depth of the unflawed part; NaN = missing.
    """

    def __init__(self, law: Law, view: View, reading_mm: Floats, clean_mm: Floats) -> None:
        self._reading_mm, self._clean_mm = reading_mm, clean_mm
        speckle_mean, speckle_sd = law.speckle_moments_mm(view)
        self._offset_mm = np.broadcast_to(speckle_mean * np.asarray(law.speckle_gain), law.shape)
        self._speckle_mm = np.broadcast_to(speckle_sd * np.asarray(law.speckle_gain), law.shape)
        white = np.square(law.white_sd_mm)
        white = white + np.asarray(law.p_outlier) * np.square(law.outlier_sd_mm)
        self._white_mm2 = np.broadcast_to(np.maximum(white, LEAST_SD_MM**2), law.shape)
        self._rounding_mm2 = law.step_mm**2 / 12  # uniform over a step
        self._smoothing = law.smoothing
        self._kernel: Floats | None = None
        if law.speckle is not None:
            self._kernel = speckle_kernel(
                law.speckle,
                grid_pitch(view.column_x_mm),
                grid_pitch(view.travel_mm),
                lay_ratio=law.lay_ratio,
                lay_angle_rad=law.lay_angle_rad,
            )
            if self._smoothing is not None:
                self._kernel = smoothed(self._kernel, self._smoothing)
        # Laplace's rule of succession for a loss where geometry sees the point
        seen = law.reason == Reason.VALID
        missing = np.isnan(reading_mm)
        missing &= seen
        lost = int(np.count_nonzero(missing))
        self._loss_nats = -math.log((lost + 1) / (int(np.count_nonzero(seen)) + 2))

    def weigh(
        self, box: tuple[slice, slice], deviation_mm: Floats, gone: int
    ) -> tuple[float, float]:
        """Return signal-to-noise ratio and response.

        Parameters
        ----------
        box
            Profiles and points of the flaw.
        deviation_mm
            Noise-free deviation there, NaN outside the flaw or where one part doesn't return.
        gone
            Points where one part returns and the other doesn't.
        """
        off = self._reading_mm[box] - self._clean_mm[box]
        used = np.isfinite(deviation_mm) & np.isfinite(off)
        deviation = np.where(used, deviation_mm, 0.0)
        white, speckle = self._white_mm2[box], self._speckle_mm[box]
        weight = deviation / (white + speckle**2 + self._rounding_mm2)
        power = self._rounding_mm2 * float(np.sum(weight**2))
        power += noise_power(weight * np.sqrt(white), self._smoothing)
        if self._kernel is not None:
            power += noise_power(weight * speckle, self._kernel)
        snr = response = 0.0
        if power > 0:
            read = np.where(used, off - self._offset_mm[box], 0.0)
            snr = float(np.sum(weight * deviation)) / math.sqrt(power)
            response = float(np.sum(weight * read)) / math.sqrt(power)
        if gone == 0:
            return snr, response
        # sure returns lost move the mean; a root of squares would shrink the readings' noise
        both = math.hypot(snr, math.sqrt(2 * gone * self._loss_nats))
        return both, both + response - snr


def noise_power(sent: Floats, correlation: Floats | None) -> float:
    """Variance of a sum of unit noise with these weights; of white noise without correlation."""
    if correlation is None:
        return float(np.sum(sent**2))
    # Σ ρ(lag) times the sum of products of the weights at that lag, which ends at their size
    centre = [(lags - 1) // 2 for lags in correlation.shape]
    reach = [min(c, size - 1) for c, size in zip(centre, sent.shape, strict=True)]
    near = correlation[tuple(slice(c - r, c + r + 1) for c, r in zip(centre, reach, strict=True))]
    shape = [
        next_fast_len(size + r, real=True) for size, r in zip(sent.shape, reach, strict=True)
    ]
    products = irfft2(np.square(np.abs(rfft2(sent, shape))), shape)
    lags = np.ix_(*(np.arange(-r, r + 1) for r in reach))
    return float(np.sum(near * products[lags]))


def evidence_of(
    flaws: int,
    instance: NDArray[np.uint16],
    hidden: NDArray[np.bool_],
    law: Law,
    view: View,
    reading_mm: Floats,
    ideal_mm: Floats,
    clean_mm: Floats,
) -> tuple[Evidence | None, ...]:
    """Return the evidence of each flaw; None for flaws that the scan does not show, and for 0.

    `hidden` are points that a flaw hides from the camera; they are gone as those where only one of
    the two parts returns. `ideal_mm` and `clean_mm` are the noise-free depths of the flawed and of
    the unflawed part; the view gives the grid of the scan, by its poses and rays.
    """
    found: list[Evidence | None] = [None]
    matched: MatchedFilter | None = None
    for number, box in enumerate(boxes_of(instance, flaws), start=1):
        if box is None:
            found.append(None)
            continue
        matched = matched or MatchedFilter(law, view, reading_mm, clean_mm)
        mine = instance[box] == number
        flawed, clean = ideal_mm[box], clean_mm[box]
        gone = (np.isnan(flawed) != np.isnan(clean)) | hidden[box]
        deviation = np.where(mine, flawed - clean, np.nan)
        both = np.abs(deviation[np.isfinite(deviation)])
        snr, response = matched.weigh(box, deviation, int(np.count_nonzero(mine & gone)))
        found.append(
            Evidence(
                snr=snr,
                response=response,
                deviation_max_mm=float(both.max()) if both.size else 0.0,
                rows=(box[0].start, box[0].stop),
                columns=(box[1].start, box[1].stop),
            )
        )
    return tuple(found)
