"""Quantisation coarser than the datasheet states."""

from dataclasses import dataclass, replace
from typing import ClassVar

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class AxisQuantisation(Effect):
    """A larger ΔZ than the sensor's: by an export, an 8-bit image, a coarse scale."""

    name: ClassVar = "axis_quantisation"
    summary: ClassVar = (
        "Delivered depths are multiples of a step coarser than the sensor's resolution."
    )
    equation: ClassVar = "z = Δ round(z / Δ): standard deviation of the rounding Δ/√12"
    source: ClassVar = (
        "Uniform error of rounding, GUM (JCGM 100:2008) F.2.2.1; steps of 4.5 and 20 µm in "
        "public recordings (sick-appspace-samples)"
    )
    statement: ClassVar = (
        "Depths are rounded to multiples of {step_um:g} µm: the export's scale is coarser than "
        "the sensor."
    )
    channels: ClassVar = ("variance",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "depth"
    rivals: ClassVar = ("pixel_locking", "roughness_level")
    separating: ClassVar = (
        "list the differences of neighbouring readings: quantised ones are multiples of one step"
    )

    step_um: float = parameter(
        "step of the delivered depths; a step below the sensor's resolution has no effect",
        unit="µm",
        low=0.0,
        high=10000.0,
        typical=20.0,
        null=0.0,
        fixed=True,
    )

    def changed(self, law: Law, view: View) -> Law:
        """Use the coarser of both steps."""
        return replace(law, step_mm=max(law.step_mm, 1e-3 * self.step_um))
