"""What filters of the firmware make of noise, drawn on what a recording scans."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.claims.filtered_noise import log_octaves
from diagnosis.claims.noise_of_recordings import OffEdges, measured
from diagnosis.fields import Field, Mask
from diagnosis.noise.noise_model import NoiseModel
from sensors.effects.onboard_filter import OnboardFilter

DRAWN_POINTS = 256
"""Points along either axis of a drawn field, at most."""
DRAWN_READINGS = 40_000
"""Readings that are drawn for each recording, at least: as many as it may have."""
MEDIANS = ((1, 3), (1, 5), (3, 1), (5, 1), (3, 3), (5, 5))
MEANS = ((1, 3), (1, 5), (1, 7), (1, 9), (3, 1), (5, 1), (7, 1), (3, 3), (5, 5))
"""Windows, profiles by points, that makers offer and that leave a scan its shape."""


def filters_on(
    recordings: Sequence[OffEdges], before: NoiseModel
) -> tuple[list[OnboardFilter], Field]:
    """List filters with what each makes of noise, drawn on what each recording scans.

    On a slope a median averages less, and where the part is bent a mean is off. A median and a mean
    together change the spectrum by about the product of what each does.

    Parameters
    ----------
    before : noise, over what the model has

    Returns
    -------
    filters, and their changes (L, R, K) of the spectrum's logarithm, see `log_octaves`
    """
    plain = OnboardFilter.none()
    medians = [plain.with_parameters(median_profiles=a, median_points=b) for a, b in MEDIANS]
    means = [plain.with_parameters(mean_profiles=c, mean_points=d) for c, d in MEANS]
    scanned = [_scanned(one, before) for one in recordings]
    without = np.stack([one.octaves(plain) for one in scanned])
    by_median, by_mean = (
        [np.stack([one.octaves(f) for one in scanned]) - without for f in each]
        for each in (medians, means)
    )
    filters = [*medians, *means]
    changes = [*by_median, *by_mean]
    for (median, first), (mean, then) in itertools.product(
        zip(medians, by_median, strict=True), zip(means, by_mean, strict=True)
    ):
        windows = {"median_profiles": median.median_profiles, "median_points": median.median_points}
        filters.append(mean.with_parameters(**windows))
        changes.append(first + then)
    return filters, np.stack(changes)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Scanned:
    """A window of a recording, as the model expects it, and noise drawn there.

    Attributes
    ----------
    plain_mm, sd_mm : (n, m) depth, and size of the noise
    drawn_mm : noise, several times
    mask : readings off edges
    """

    plain_mm: Field
    drawn_mm: Sequence[Field]
    sd_mm: Field
    mask: Mask
    like: NoiseModel

    def octaves(self, firmware: OnboardFilter) -> Field:
        """Return the spectrum's logarithm behind a filter."""
        left = [
            (firmware.filtered(self.plain_mm + drawn) - self.plain_mm) / self.sd_mm
            for drawn in self.drawn_mm
        ]
        return log_octaves(measured(left, [self.mask] * len(left), self.like))


def _scanned(recording: OffEdges, before: NoiseModel) -> _Scanned:
    """Draw noise on a window of a recording's largest patch."""
    k = int(np.argmax([m.sum() for m in recording.masks]))
    patch, state, mask = recording.patches[k], recording.states[k], recording.masks[k]
    rows, columns = (min(n, DRAWN_POINTS) for n in patch.shape)
    first, left = ((n - size) // 2 for n, size in zip(patch.shape, (rows, columns), strict=True))
    at = np.s_[first : first + rows, left : left + columns]
    root = np.sqrt(np.maximum(before.spectrum((DRAWN_POINTS, DRAWN_POINTS)), 0.0))
    rng, sd_mm = np.random.default_rng(0), before.sd_mm * state.sd_mm[at]
    drawn = [
        np.fft.ifft2(root * np.fft.fft2(rng.standard_normal(root.shape))).real[:rows, :columns]
        for _ in range(math.ceil(DRAWN_READINGS / (rows * columns)))
    ]
    return _Scanned(
        plain_mm=np.where(patch.observed, patch.plain_mm, np.nan)[at],
        drawn_mm=[sd_mm * one for one in drawn], sd_mm=state.sd_mm[at], mask=mask[at], like=before,
    )  # fmt: skip
