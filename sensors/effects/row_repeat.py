"""Repeated profiles: a profile is delivered again in place of the next."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.delivery import DeliveryEffect
from sensors.effects.parameter import parameter
from sensors.law import Law, RngOf
from sensors.recording import repeated_rows
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class RowRepeat(DeliveryEffect):
    """Each profile but the first repeats the previous one with a constant probability."""

    name: ClassVar = "row_repeat"
    summary: ClassVar = (
        "Some profiles repeat the previous one, reading for reading, while the encoder advances."
    )
    equation: ClassVar = "profile i = delivered profile i-1 with probability share"
    source: ClassVar = (
        "Encoder pulses faster than the profile rate, as Bernoulli trials; 14, 23 and 41 % of the "
        "profiles of three public recordings (sick-appspace-samples), none in three others"
    )
    statement: ClassVar = (
        "{share:.1%} of the profiles repeat the previous profile: they are no measurements, and "
        "their readings belong one profile back."
    )
    channels: ClassVar = ("mean", "variance")
    secondary_channels: ClassVar = ("missing", "correlation")
    frame: ClassVar = "time"
    covariate: ClassVar = "time"
    rivals: ClassVar = ("motion_blur", "travel_ripple")
    separating: ClassVar = (
        "compare each profile with the previous one, reading for reading; scan more slowly"
    )

    share: float = parameter(
        "probability that a profile repeats the previous one",
        low=0.0,
        high=0.9,
        typical=0.15,
        null=0.0,
        fixed=True,
    )

    def claimed(self, law: Law, view: View) -> Law:
        """Mix each profile's law with that of the profile delivered before.

        The moments of the mixture follow by recursion over the profiles: with probability `share`,
        the delivered profile i is the delivered profile i-1.
        """
        shape = law.shape
        seen = np.isfinite(law.mean_mm)
        found = np.where(seen, 1.0 - law.p_missing, 0.0)
        mean = np.where(seen, law.mean_mm, 0.0)
        parts = {
            name: np.array(np.broadcast_to(np.square(getattr(law, name)), shape))
            for name in ("white_sd_mm", "speckle_gain", "outlier_sd_mm")
        }
        parts["p_outlier"] = np.array(np.broadcast_to(law.p_outlier, shape), dtype=np.float64)
        for i in range(1, shape[0]):
            own, before = (1.0 - self.share) * found[i], self.share * found[i - 1]
            found[i] = own + before
            weight = np.divide(before, found[i], out=np.zeros_like(before), where=found[i] > 0)
            step = mean[i - 1] - mean[i]
            for value in parts.values():
                value[i] += weight * (value[i - 1] - value[i])
            parts["white_sd_mm"][i] += weight * (1.0 - weight) * np.square(step)
            mean[i] += weight * step
        return replace(
            law,
            mean_mm=np.where(found > 0, mean, np.nan),
            reason=np.where(found > 0, np.uint8(0), law.reason).astype(np.uint8),
            white_sd_mm=np.sqrt(parts["white_sd_mm"]),
            speckle_gain=np.sqrt(parts["speckle_gain"]),
            p_missing=np.clip(1.0 - found, 0.0, 1.0),
            p_outlier=parts["p_outlier"],
            outlier_sd_mm=np.sqrt(parts["outlier_sd_mm"]),
        )

    def deliver(
        self, depth_mm: Floats, reason: NDArray[np.uint8], rng_of: RngOf
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """Repeat profiles, each with probability `share`."""
        again = rng_of(self.name).random(len(depth_mm)) < self.share
        again[0] = False
        source = _source(again)
        return depth_mm[source], reason[source]


def brightness_delivered(levels: NDArray[np.uint8], depth_mm: Floats) -> NDArray[np.uint8]:
    """Return the brightness (n, m) that comes with readings of which profiles repeat.

    A repeated profile repeats its brightness.
    """
    return levels[_source(repeated_rows(depth_mm))]


def _source(again: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Index of the profile whose readings each delivered profile holds."""
    return np.maximum.accumulate(np.where(again, 0, np.arange(again.size)))
