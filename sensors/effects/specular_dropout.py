"""Missing readings where a specular surface sends the camera too little light, or too much."""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.line.line_operator import Line, bright_line, line_sd_mm
from sensors.view.view import View
from sensors.view.view_cache import ViewCache

Floats = NDArray[np.float64]

_EVEN: ViewCache[Line] = ViewCache(4)
STEEPEST_DEG = 80.0
"""Incidence beyond which the signal is held constant."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SpecularDropout(Effect):
    """Logistic in the log signal of a diffuse part and a specular lobe about the half vector."""

    name: ClassVar = "specular_dropout"
    summary: ClassVar = (
        "A specular surface reflects the light past the camera (dropout) or straight into the "
        "camera (saturation)."
    )
    equation: ClassVar = (
        "S = ρ cos β + (1-ρ) exp(-tan²α / m²); p = share · logistic(±(ln S - ln threshold) / "
        "softness); a line of stated width has the signal Σ L S / Σ L and the centroid "
        "Σ L S [z + κ η cot θ] / Σ L S; a listed footprint along the line: Σ L S z / Σ L S"
    )
    source: ClassVar = (
        "Specular lobe of microfacets about the half vector: Torrance and Sparrow, J. Opt. Soc. "
        "Am. 57 (1967) 1105; Beckmann slope distribution"
    )
    statement: ClassVar = (
        "Readings are missing where the reflected light is too {kind}, as a specular lobe of "
        "{lobe_deg:.1f}° predicts."
    )
    channels: ClassVar = ("missing",)
    secondary_channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "half_vector"
    relaxed: ClassVar = (Relaxed(channel="missing", along=("half_vector",)),)
    rivals: ClassVar = ("camera_occlusion", "random_dropout", "reflectance_edge")
    separating: ClassVar = (
        "spray the part matt: these readings return; shadows, which are sharp and geometric, stay"
    )
    needs: ClassVar = ("triangulation_angle_deg",)

    share: float = parameter(
        "largest probability of a missing reading",
        low=0.0,
        high=1.0,
        typical=0.9,
        null=0.0,
        grid=(0.1, 0.9),
    )
    lobe_deg: float = parameter(
        "width m of the specular lobe, as an angle of microfacets",
        unit="°",
        low=1.0,
        high=45.0,
        typical=8.0,
        grid=(3.0, 6.0, 10.0, 15.0, 25.0),
    )
    matt: float = parameter(
        "share ρ of the diffuse part in the signal at the lobe's peak",
        low=0.0,
        high=1.0,
        typical=0.05,
    )
    threshold: float = parameter(
        "signal at which the probability is half of `share`",
        low=0.0001,
        high=2.0,
        typical=0.03,
        grid=(0.03, 0.1, 0.3, 0.8),
    )
    softness: float = parameter(
        "width of the transition in the logarithm of the signal",
        low=0.01,
        high=3.0,
        typical=0.3,
    )
    kind: str = parameter(
        "whether too little or too much light loses the reading",
        typical="weak",
        choices=("weak", "strong"),
    )

    def variants(self, view: View) -> tuple[Self, ...]:
        """Return weaker diffuse parts: flats constrain only their ratio to the threshold."""
        low = self.parameter("threshold").low
        return tuple(
            self.with_parameters(matt=self.matt * k, threshold=self.threshold * k)
            for k in (0.1, 0.3)
            if self.threshold * k >= low
        )

    def changed(self, law: Law, view: View) -> Law:
        """Add the probability of a missing reading, and the centroid bias towards lit parts."""
        if self.kind == "weak" and view.datasheet.line_width_um is not None:
            bias, signal = self._lit(view)
            law = law.biased(self.share * bias)
        else:
            signal = self._signal(view)
        with np.errstate(divide="ignore"):
            excess = (np.log(signal) - math.log(self.threshold)) / self.softness
        missing = self.share * expit(-excess if self.kind == "weak" else excess)
        return law.losing(np.where(view.in_range, missing, 0.0))

    def _lit(self, view: View) -> tuple[Floats, Floats]:
        """Centroid bias of a line towards its lit part, (n, m) mm, and its signal, (n, m).

        A line with one half on a dark facet is read by its other half. The same holds for a
        footprint along the line, where the file lists one. The biases add. Of the two signals the
        larger change counts where one is brighter, and the smaller signal where none is.
        """
        across = float(line_sd_mm(view, None, None))
        bias, signal = self._lit_along(view, across, "y", 1e-3 * view.sensor.beam.merge_um)
        along = 1e-3 * view.sensor.beam.along_um
        if along:
            further, other = self._lit_along(view, along, "x", None)
            bias = bias + further
            signal = np.fmax(signal + other - self._signal(view), np.fmin(signal, other))
        return bias, signal

    def _lit_along(
        self, view: View, sd_mm: float, axis: str, merge_mm: float | None
    ) -> tuple[Floats, Floats]:
        even = _even(view, sd_mm, axis, merge_mm)
        line = bright_line(view, sd_mm, self._signal, axis=axis, merge_mm=merge_mm)
        # a part of the line hidden from the camera makes no facet darker
        signal = line.light / np.where(even.light > 0, even.light, 1.0)
        return np.nan_to_num(line.depth_mm - even.depth_mm), signal

    def _signal(self, view: View) -> Floats:
        """Light that reaches the camera, (n, m), 1 at the lobe's peak."""
        return returned_light(view, self.matt, self.lobe_deg)


def returned_light(view: View, matt: float, lobe_deg: float) -> Floats:
    """Return the light that reaches the camera, (n, m), 1 at the peak of a white surface's lobe.

    Parameters
    ----------
    view : View
        The scan; its part's reflectance scales the light, unless a recording gives the brightness.
    matt : float
        Share of the diffuse part, Lambert's cosine, at the lobe's peak.
    lobe_deg : float
        Width of the specular lobe, as an angle of microfacets.
    """
    cosine = np.maximum(view.cos_half_vector, math.cos(math.radians(STEEPEST_DEG)))
    # tan² α = 1 / cos² α - 1
    lobe = np.exp((1.0 - cosine**-2) / math.tan(math.radians(lobe_deg)) ** 2)
    signal = matt * view.cos_incidence + (1.0 - matt) * lobe
    if view.reflectance is not None and view.intensity is None:
        signal = signal * view.reflectance.at(view.part_mm)
    return np.asarray(signal)


def _even(view: View, sd_mm: float, axis: str, merge_mm: float | None) -> Line:
    """Read the line as if it were equally bright; cached by view."""
    return _EVEN.get(
        view, (sd_mm, axis, merge_mm),
        lambda: bright_line(
            view, sd_mm, lambda _: np.ones((1, 1)), axis=axis, merge_mm=merge_mm
        ),
    )  # fmt: skip
