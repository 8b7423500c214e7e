"""Outliers: a small share of the readings has a much larger variance."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class OutlierSpikes(Effect):
    """A second, wide Gaussian with a small weight."""

    name: ClassVar = "outlier_spikes"
    summary: ClassVar = "Isolated readings are outliers: the distribution has wide tails."
    equation: ClassVar = "(1-p) N(z, σ²) + p N(z, σ² + width²)"
    source: ClassVar = "Contaminated normal distribution, Tukey 1960; 0.1 to 2 % of readings"
    statement: ClassVar = "{share:.2%} of the readings are outliers of about {width_um:.0f} µm."
    channels: ClassVar = ("tails",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "time"
    relaxed: ClassVar = (Relaxed(channel="outliers", grows=True),)
    rivals: ClassVar = ("edge_mixing",)
    separating: ClassVar = "map the outliers: they lie anywhere, mixed readings lie at edges"

    share: float = parameter(
        "share p of the readings",
        low=0.0,
        high=0.5,
        typical=0.005,
        null=0.0,
        grid=(0.001, 0.005, 0.02),
    )
    width_um: float = parameter(
        "standard deviation of an outlier beyond the noise",
        unit="µm",
        low=1.0,
        high=50000.0,
        typical=300.0,
        grid=(100.0, 300.0, 1000.0),
    )

    def changed(self, law: Law, view: View) -> Law:
        """Add weight to the second Gaussian; two outlier effects mix by weight and variance."""
        width = self.width_um * 1e-3
        before = law.p_outlier
        both = 1.0 - (1.0 - before) * (1.0 - self.share)
        if not np.any(before):
            return replace(law, p_outlier=both, outlier_sd_mm=width)
        variance = before * np.square(law.outlier_sd_mm) + (both - before) * width**2
        return replace(law, p_outlier=both, outlier_sd_mm=np.asarray(np.sqrt(variance / both)))
