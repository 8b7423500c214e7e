"""Falloff of the laser line's light towards its ends: more noise and missing readings."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class LightFalloff(Effect):
    """Signal as a Gaussian of the position along the line; noise and dropout depend on it."""

    name: ClassVar = "light_falloff"
    summary: ClassVar = (
        "The line's light falls off from its middle to its ends, where the noise grows and "
        "readings are missing."
    )
    equation: ClassVar = (
        "ln S = ln(ends) ((x - middle) / (x_fov/2))²; noise × S^(-noise_exponent); "
        "p = share · logistic((ln threshold - ln S) / softness)"
    )
    source: ClassVar = (
        "Gaussian beam spread by a cylindrical lens, Siegman, Lasers (1986), ch. 17, and cos⁴ of "
        "the imaging lens, which is a Gaussian to lowest order; standard deviation of a peak's "
        "position over the root of its photons: Winick, J. Opt. Soc. Am. A 3 (1986) 1809"
    )
    statement: ClassVar = (
        "The laser line has {ends:.0%} of its light at the ends: the noise there is larger, and "
        "up to {share:.0%} of the readings are missing."
    )
    channels: ClassVar = ("missing", "variance")
    frame: ClassVar = "sensor"
    covariate: ClassVar = "x"
    relaxed: ClassVar = (
        Relaxed(channel="missing", along=("x",)),
        Relaxed(channel="scale", along=("x",)),
    )
    rivals: ClassVar = ("random_dropout", "specular_dropout", "incidence_noise")
    separating: ClassVar = (
        "shift the part along the line: noise and missing readings caused by the line's light "
        "stay at the ends of the line"
    )

    ends: float = parameter(
        "signal at the ends of the line at the working distance, over that at its middle",
        low=0.001,
        high=1.0,
        typical=0.3,
        null=1.0,
        grid=(0.05, 0.3),
    )
    middle_mm: float = parameter(
        "x from the optical axis at which the line is brightest",
        unit="mm",
        low=-1000.0,
        high=1000.0,
        typical=0.0,
    )
    noise_exponent: float = parameter(
        "power of the signal by which the noise grows: 0.5 for photon noise, 1 for read-out noise "
        "of the camera, 0 for neither",
        low=0.0,
        high=1.0,
        typical=0.5,
        fixed=True,
    )
    share: float = parameter(
        "largest probability of a missing reading",
        low=0.0,
        high=1.0,
        typical=0.9,
    )
    threshold: float = parameter(
        "signal at which the probability is half of `share`",
        low=0.0001,
        high=1.0,
        typical=0.3,
        grid=(0.1, 0.5),
    )
    softness: float = parameter(
        "width of the transition in the logarithm of the signal",
        low=0.01,
        high=3.0,
        typical=0.3,
        fixed=True,
    )

    def changed(self, law: Law, view: View) -> Law:
        """Scale the noise by the signal's power, add the probability of a missing reading."""
        log_signal = self.log_signal(view)
        gain = np.exp(-self.noise_exponent * log_signal)
        missing = self.share * expit((math.log(self.threshold) - log_signal) / self.softness)
        return law.noisier(gain).losing(missing)

    def log_signal(self, view: View) -> Floats:
        """Logarithm of the light over its maximum, (n, m); 0 at missing readings."""
        half_mm = view.datasheet.x_fov_mm / 2
        away = np.where(view.in_range, view.off_axis_mm - self.middle_mm, 0.0) / half_mm
        return np.asarray(math.log(self.ends) * np.square(away))
