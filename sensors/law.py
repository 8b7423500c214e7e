"""The predictive distribution of a reading at each point of a scan, and draws from it.

For each point: mean depth, standard deviation and correlation of the noise, probability of a
missing reading, weight and width of outliers. The nominal law is geometry, Perlin speckle and
equation 10 of Sensors 2023, 23, 7624; effects map one law to another.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensors.noise.perlin import grid_pitch
from sensors.noise.speckle import Speckle
from sensors.noise.uncertainty import quantise, sigma_mm
from sensors.sampling import sample
from sensors.surface.surface import Surface
from sensors.view.view import Reason, View

Floats = NDArray[np.float64]
RngOf = Callable[[str], np.random.Generator]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Law:
    """Predictive distribution at n x m points; arrays broadcast to (n, m).

    Attributes
    ----------
    mean_mm : (n, m)
        Mean depth; NaN where the geometry gives no reading.
    reason : (n, m) uint8
        Reason of a missing reading, see `Reason`.
    white_sd_mm
        Standard deviation of noise independent from point to point.
    speckle : Speckle or None
        Correlated noise, in mm.
    speckle_gain
        Factor on the speckle at each point.
    lay_ratio, lay_angle_rad : float
        Stretch of the speckle along a direction, and that direction from the sensor's x towards
        y; 1 leaves it as it is.
    p_missing
        Probability of a missing reading at a point that geometry sees.
    missing_patch_mm : float
        Size of the patches in which points go missing; 0: each for itself.
    p_outlier, outlier_sd_mm
        Weight and width of a second Gaussian.
    step_mm : float
        ΔZ, readings are rounded to its multiples; 0: they aren't.
    delivery : Delivery or None
        Law of what was measured and what the firmware makes of it, where that isn't delivered as
        it is. The attributes above are the moments of what is delivered.
    """

    mean_mm: Floats
    reason: NDArray[np.uint8]
    white_sd_mm: Floats | float = 0.0
    speckle: Speckle | None = None
    speckle_gain: Floats | float = 1.0
    lay_ratio: float = 1.0
    lay_angle_rad: float = 0.0
    p_missing: Floats | float = 0.0
    missing_patch_mm: float = 0.0
    p_outlier: Floats | float = 0.0
    outlier_sd_mm: Floats | float = 0.0
    step_mm: float = 0.0
    delivery: "Delivery | None" = None

    @property
    def shape(self) -> tuple[int, int]:
        """Profiles and points of a profile."""
        n, m = self.mean_mm.shape
        return n, m

    def without(self, where: NDArray[np.bool_], reason: Reason) -> "Law":
        """Return the law without readings where `where` (n, m) holds, with their reason."""
        reasons = self.reason.copy()
        reasons[where & (reasons == Reason.VALID)] = reason
        return dataclasses.replace(
            self, mean_mm=np.where(where, np.nan, self.mean_mm), reason=reasons
        )

    def biased(self, by_mm: Floats) -> "Law":
        """Return the law with its mean moved by so much, (n, m) mm."""
        return dataclasses.replace(self, mean_mm=self.mean_mm + by_mm)

    def noisier(self, gain: Floats) -> "Law":
        """Return the law with all its noise, white and speckle, times a gain (n, m)."""
        return dataclasses.replace(
            self,
            white_sd_mm=np.asarray(self.white_sd_mm * gain),
            speckle_gain=np.asarray(self.speckle_gain * gain),
        )

    def losing(self, p: Floats | float) -> "Law":
        """Return the law with a further, independent probability of a missing reading."""
        return dataclasses.replace(self, p_missing=1.0 - (1.0 - self.p_missing) * (1.0 - p))

    @property
    def smoothing(self) -> Floats | None:
        """Correlation of white noise as it is delivered, see `Delivery`; None where it is white."""
        if self.delivery is None:
            return None
        own, before = self.delivery.smoothing, self.delivery.measured.smoothing
        return own if before is None else before if own is None else smoothed(before, own)

    @classmethod
    def average(cls, laws: Sequence["Law"]) -> "Law":
        """Mixture of equally likely laws of one kind, by its first two moments.

        What scatters between their means counts as white; a point that some of them don't see is
        missing with that probability, and has no mean where none sees it.
        """
        means = np.stack([law.mean_mm for law in laws])
        seen = np.isfinite(means)
        share = seen.mean(axis=0)
        with np.errstate(invalid="ignore"):
            mean = np.where(seen, means, 0.0).sum(axis=0) / seen.sum(axis=0)
            scatter = (np.where(seen, means - mean, 0.0) ** 2).sum(axis=0) / seen.sum(axis=0)
        white = np.mean([np.square(law.white_sd_mm) for law in laws], axis=0)
        first = laws[0]
        return dataclasses.replace(
            first,
            mean_mm=mean,
            reason=first.reason if share.all() else _first_reason(laws, share),
            white_sd_mm=np.sqrt(white + np.where(share > 0, scatter, 0.0)),
            speckle_gain=_middle([law.speckle_gain for law in laws], square=True),
            p_missing=_missing(laws, seen),
            p_outlier=_middle([law.p_outlier for law in laws]),
            outlier_sd_mm=_middle([law.outlier_sd_mm for law in laws], square=True),
        )

    def speckle_moments_mm(self, view: View) -> tuple[float, float]:
        """Return mean and standard deviation of the speckle before its gain, on the grid, mm."""
        if self.speckle is None:
            return 0.0, 0.0
        return self.speckle.moments_mm(grid_pitch(view.column_x_mm), grid_pitch(view.travel_mm))

    def speckle_sd_mm(self, view: View) -> float:
        """Return the standard deviation of the speckle before its gain, on the scan's grid, mm."""
        return self.speckle_moments_mm(view)[1]

    def sd_mm(self, view: View) -> Floats:
        """Return the standard deviation before rounding, outliers apart, (n, m) mm."""
        speckle = self.speckle_gain * np.float64(self.speckle_sd_mm(view))
        return np.broadcast_to(np.hypot(self.white_sd_mm, speckle), self.shape)

    def sample(self, rng_of: RngOf, view: View) -> tuple[Floats, NDArray[np.uint8]]:
        """Draw one scan.

        Parameters
        ----------
        rng_of : function
            Gives the generator of a named stream: "speckle", "uncertainty", "outliers", "dropout"
            and those of the delivery are asked for, each only where the law needs it.
        view : View
            The scan that the law belongs to; its columns and travel place the speckle.

        Returns
        -------
        depth_mm : (n, m) float64
            Readings, NaN where missing; those that noise takes beyond the working range are.
        reason : (n, m) uint8
            Why they are missing.
        """
        if self.delivery is not None:
            depth_mm, reason = self.delivery.measured.sample(rng_of, view)
            depth_mm, reason = self.delivery.deliver(depth_mm, reason, rng_of)
            return quantise(depth_mm, self.step_mm), reason
        return sample(self, rng_of, view)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Delivery:
    """Readings as measured, and what the firmware makes of them.

    Attributes
    ----------
    measured : Law
    deliver : function
        Turns depths (n, m), mm, and reasons into those delivered.
    smoothing : (2a + 1, 2b + 1), optional
        Correlation that white noise has once it is delivered, 1 in the middle; rows are lags along
        the travel. None where it stays white.
    """

    measured: Law
    deliver: Callable[[Floats, NDArray[np.uint8], RngOf], tuple[Floats, NDArray[np.uint8]]]
    smoothing: Floats | None = None


def smoothed(correlation: Floats, smoothing: Floats) -> Floats:
    """Correlation of noise that had one already, once it is smoothed."""
    from scipy.signal import convolve  # loads a second of scipy

    full: Floats = convolve(correlation, smoothing)
    return np.asarray(full / full[full.shape[0] // 2, full.shape[1] // 2])


def _middle(values: Sequence[Floats | float], *, square: bool = False) -> Floats | float:
    """Mean (or root of the mean square) of values, as it is where they are one and the same."""
    if all(v is values[0] for v in values):
        return values[0]
    if square:
        return np.asarray(np.sqrt(np.mean([np.square(v) for v in values], axis=0)))
    return np.asarray(np.mean([np.asarray(v) for v in values], axis=0))


def _missing(laws: Sequence[Law], seen: NDArray[np.bool_]) -> Floats | float:
    p = [law.p_missing for law in laws]
    if all(v is p[0] for v in p) and (seen == seen[0]).all():
        return p[0]
    returned = np.mean([np.where(s, 1.0 - v, 0.0) for v, s in zip(p, seen, strict=True)], axis=0)
    return np.asarray(np.where(seen.any(axis=0), 1.0 - returned, 0.0))


def _first_reason(laws: Sequence[Law], share: Floats) -> NDArray[np.uint8]:
    reason = np.max([law.reason for law in laws], axis=0)
    return np.where(share > 0, np.uint8(0), reason).astype(np.uint8)


def geometric_law(view: View, surface: Surface | Speckle | None) -> Law:
    """Law of the paper: geometry, Perlin speckle, equation 10; no effects.

    A surface that isn't calibrated yet is calibrated here, for each scan anew (seconds): have
    `Surface.ready` do that once, or give the field itself.
    """
    return Law(
        mean_mm=view.depth_mm,
        reason=view.reason,
        white_sd_mm=sigma_mm(view.datasheet),
        speckle=_speckle(view, surface),
        step_mm=view.datasheet.step_mm,
    )


def _speckle(view: View, surface: Surface | Speckle | None) -> Speckle | None:
    if surface is None or isinstance(surface, Speckle):
        return surface
    sheet = view.datasheet
    ready = surface.ready(
        grid_pitch(view.column_x_mm) or None,
        grid_pitch(view.travel_mm) or None,
        z_resolution_um=sheet.z_resolution_um,
        repeatability_um=sheet.repeatability_um or 0.0,
    )
    return ready.field()
