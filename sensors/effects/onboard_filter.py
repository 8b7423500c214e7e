"""The sensor's firmware filters readings: gaps filled, median, mean."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.delivery import DeliveryEffect
from sensors.effects.parameter import parameter
from sensors.law import Law, RngOf
from sensors.noise.perlin import grid_pitch
from sensors.noise.speckle import Speckle
from sensors.noise.window_filters import (
    gaps_filled,
    median_law,
    weighted_sum,
    windowed_mean,
    windowed_median,
)
from sensors.view.view import Reason, View

Floats = NDArray[np.float64]

DRAWN_POINTS = 192
"""Points along either axis of the speckle whose variance after the filter is taken."""


def window(of: str, *, high: int, typical: int) -> Any:
    """Declare a filter's window, readings."""
    return parameter(
        f"window of the {of}; 1: none", low=1, high=high, typical=typical, null=1, kind="integer"
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class OnboardFilter(DeliveryEffect):
    """Gap filling along the line, then a median, then a mean, each over a window.

    Windows are odd; an even number counts as the next odd one. The filter's linear equivalent
    averages readings of a flat. On a slope steeper than the noise a median averages less, in
    proportion to the share of the window within the noise of its centre.
    """

    name: ClassVar = "onboard_filter"
    summary: ClassVar = (
        "The sensor's firmware smooths readings and fills gaps before delivery: the noise is "
        "smaller and correlated, edges are rounded."
    )
    equation: ClassVar = (
        "z = mean over (mean_profiles × mean_points) of the median over (median_profiles × "
        "median_points); variance of a median Σp(1-p)/(Σf)² · 2c/(2c + π - 2), c = (Σf)²/Σf²; of "
        "both together n Σk² times that, k the equivalent kernel"
    )
    source: ClassVar = (
        "Filters that makers document (Gocator: gap filling, median, smoothing; Keyence LJ-X: "
        "median, averaging); variance of a median: sensors/noise/window_filters.py"
    )
    statement: ClassVar = (
        "The firmware filtered the readings ({windows}): their noise is smaller and correlated "
        "over the window, which is no property of the surface."
    )
    channels: ClassVar = ("variance", "correlation")
    secondary_channels: ClassVar = ("mean", "missing", "tails")
    frame: ClassVar = "sensor"
    covariate: ClassVar = "curvature_y"
    rivals: ClassVar = ("roughness_level", "finite_spot", "motion_blur")
    separating: ClassVar = "switch the filters off in the sensor's settings and scan again"

    median_points: int = window("median along the line", high=63, typical=3)
    median_profiles: int = window("median along the travel", high=63, typical=3)
    mean_points: int = window("mean along the line", high=255, typical=5)
    mean_profiles: int = window("mean along the travel", high=255, typical=1)
    gap_points: int = parameter(
        "longest gap along the line that is filled by a straight line; 0: none",
        low=0,
        high=1000,
        typical=0,
        null=0,
        kind="integer",
    )

    @property
    def median_window(self) -> tuple[int, int]:
        """Profiles and points of the median's window, odd."""
        return _odd(self.median_profiles), _odd(self.median_points)

    @property
    def mean_window(self) -> tuple[int, int]:
        """Profiles and points of the mean's window, odd."""
        return _odd(self.mean_profiles), _odd(self.mean_points)

    def filtered(self, depth_mm: Floats) -> Floats:
        """Apply the filters to readings (n, m)."""
        if self.gap_points:
            depth_mm = gaps_filled(depth_mm, self.gap_points)
        return self._smoothed(depth_mm)

    def _smoothed(self, depth_mm: Floats) -> Floats:
        if self.median_window != (1, 1):
            depth_mm = windowed_median(depth_mm, *self.median_window)
        if self.mean_window != (1, 1):
            depth_mm = windowed_mean(depth_mm, *self.mean_window)
        return depth_mm

    def deliver(
        self, depth_mm: Floats, reason: NDArray[np.uint8], rng_of: RngOf
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """Filter the readings; a filled gap counts as readings."""
        delivered = self.filtered(depth_mm)
        found = np.isfinite(delivered)
        return delivered, np.where(found, np.uint8(Reason.VALID), reason).astype(np.uint8)

    def claimed(self, law: Law, view: View) -> Law:
        """Filter the mean, reduce noise and outliers, fill gaps up to the stated length."""
        shape, before = law.shape, np.asarray(law.mean_mm)
        mean = gaps_filled(before, self.gap_points) if self.gap_points else before
        seen = np.isfinite(mean)
        white = np.square(law.white_sd_mm) + law.step_mm**2 / 12  # rounded before it is filtered
        white = np.where(seen, np.broadcast_to(white, shape), 0.0)
        gain = np.broadcast_to(np.square(law.speckle_gain), shape)
        kept = self._speckle_kept(law, view)
        loose = white + gain * law.speckle_sd_mm(view) ** 2 * (1.0 - kept[-1])
        variance, shares = np.ones(shape), [np.zeros(shape), np.zeros(shape)]
        if self.median_window != (1, 1):
            window = np.array(self.median_window)
            mean, variance, *level = median_law(mean, np.sqrt(loose), window)
            shares = [(1 - 1 / c) / (1 - 1 / max(w, 2)) for c, w in zip(level, window, strict=True)]
        averaged = [a * b * self._averaged(seen, (a, b)) for a, b in self._windows()]
        white = windowed_mean(np.where(seen, white * variance, np.nan), *self.mean_window)
        white = np.nan_to_num(white) * _between(averaged, *shares)
        spikes = self._spikes(law.p_outlier)
        return replace(
            law,
            mean_mm=windowed_mean(mean, *self.mean_window),
            reason=np.where(seen, np.uint8(0), law.reason).astype(np.uint8),
            white_sd_mm=np.sqrt(white),
            speckle_gain=np.sqrt(gain * _between(kept, *shares)),
            p_missing=np.where(np.isfinite(before), self._still_missing(law, view), 0.0),
            p_outlier=spikes,
            outlier_sd_mm=law.outlier_sd_mm / math.prod(self.mean_window),
        )

    def smoothing(self) -> Floats:
        """Return the autocorrelation of the equivalent linear filter."""
        down, across = (self._kernel(axis, self.median_window) for axis in (0, 1))
        both = np.outer(np.correlate(down, down, "full"), np.correlate(across, across, "full"))
        return np.asarray(both / both.max())

    def _kernel(self, axis: int, median: tuple[int, int]) -> Floats:
        """Weights of the equivalent linear filter along an axis."""
        wide, narrow = (np.full(w, 1 / w) for w in (self.mean_window[axis], median[axis]))
        return np.asarray(np.convolve(wide, narrow), dtype=np.float64)

    def _windows(self) -> tuple[tuple[int, int], ...]:
        """Windows of a median that averages along no axis, the line, the travel, or both."""
        down, across = self.median_window
        return (1, 1), (1, across), (down, 1), (down, across)

    def _averaged(self, seen: NDArray[np.bool_], median: tuple[int, int]) -> Floats:
        """Variance of white noise of unit variance after the equivalent linear filter, (n, m)."""
        weighted = mass = seen.astype(np.float64)
        for axis in (0, 1):
            kernel = self._kernel(axis, median)
            weighted = weighted_sum(weighted, kernel**2, axis)
            mass = weighted_sum(mass, kernel, axis)
        return weighted / np.square(np.where(seen, mass, 1.0))

    def _speckle_kept(self, law: Law, view: View) -> tuple[float, ...]:
        """Ratios of the speckle's variance after the filter to that before, per median window."""
        if law.speckle is None:
            return (1.0,) * 4
        pitches = (grid_pitch(view.column_x_mm) or 1.0, grid_pitch(view.travel_mm) or 1.0)
        return _variance_left(law.speckle, pitches, self._windows(), self.mean_window)

    def _spikes(self, share: Floats | float) -> Floats | float:
        """Share of outliers after the filter: a majority in a median's window, any in a mean's."""
        count, width = math.prod(self.median_window), math.prod(self.mean_window)
        if not np.any(share):
            return share
        from scipy.stats import binom  # loads a second of scipy

        left = binom.sf((count - 1) // 2, count, share) if count > 1 else share
        return np.asarray(1.0 - (1.0 - left) ** width)

    def _still_missing(self, law: Law, view: View) -> Floats | float:
        """Probability of a missing reading whose gap is too long to be filled.

        Where readings are missing independently with probability p, a missing reading lies in a
        gap of length l with probability l p^(l-1) (1-p)².
        """
        p = law.p_missing
        if not self.gap_points or not np.any(p):
            return p
        if law.missing_patch_mm > self.gap_points * (grid_pitch(view.column_x_mm) or 1.0):
            return p
        length = np.arange(1, self.gap_points + 1)[:, None, None]
        share = np.broadcast_to(p, law.shape)
        short = np.sum(length * share ** (length - 1) * np.square(1.0 - share), axis=0)
        return np.asarray(share * (1.0 - short))

    def words(self) -> dict[str, Any]:
        """Return the filters for the statement."""
        (a, b), (c, d) = self.median_window, self.mean_window
        found = []
        if self.gap_points:
            found.append(f"gaps of up to {self.gap_points} points filled")
        if (a, b) != (1, 1):
            found.append(f"median over {a} profiles × {b} points")
        if (c, d) != (1, 1):
            found.append(f"mean over {c} × {d}")
        return {"windows": ", ".join(found) or "no filter"}


@functools.lru_cache(maxsize=64)
def _variance_left(
    speckle: Speckle,
    pitches: tuple[float, float],
    medians: tuple[tuple[int, int], ...],
    mean: tuple[int, int],
) -> tuple[float, ...]:
    """Variance of speckle behind a mean of each median, over that of before.

    Estimated on one draw from a fixed seed at the scan's pitches: no closed form is known for the
    median of correlated heights.
    """
    x_mm, y_mm = (np.arange(DRAWN_POINTS, dtype=np.float64) * pitch for pitch in pitches)
    field = speckle.sample(x_mm, y_mm, np.random.default_rng(0))
    behind = (windowed_mean(windowed_median(field, *window), *mean) for window in medians)
    left = [float(np.var(one)) for one in behind]
    return tuple(value / (float(np.var(field)) or 1.0) for value in left)


def _between(corners: Sequence[Floats | float], down: Floats, across: Floats) -> Floats:
    """Interpolate between four values by the shares of both axes."""
    neither, along, travel, both = corners
    first = neither + across * (along - neither)
    return np.asarray(first + down * (travel + across * (both - travel) - first))


def _odd(window: int) -> int:
    return 2 * (window // 2) + 1
