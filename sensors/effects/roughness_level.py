"""The surface is rougher or smoother than its stated figures."""

from dataclasses import dataclass, replace
from typing import ClassVar

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class RoughnessLevel(Effect):
    """Factors on the speckle's height and on its peak density."""

    name: ClassVar = "roughness_level"
    summary: ClassVar = (
        "The noise is larger or finer everywhere than the surface's stated figures predict."
    )
    equation: ClassVar = "heights × amplitude, peaks per mm × peaks"
    source: ClassVar = (
        "Amplitude and control points of the Perlin model, Sensors 2023, 23, 7624, section 2.2.2"
    )
    statement: ClassVar = (
        "The surface's noise has {amplitude:.2f} times the amplitude and {peaks:.2f} times the "
        "peaks per mm of its stated figures."
    )
    channels: ClassVar = ("variance", "correlation")
    frame: ClassVar = "part"
    covariate: ClassVar = "part_x"
    rivals: ClassVar = ("incidence_noise", "anisotropic_lay")
    separating: ClassVar = (
        "scan a flat plate of the same surface texture: the roughness level holds everywhere, "
        "incidence noise on slopes only"
    )

    amplitude: float = parameter(
        "factor on the heights",
        low=0.05,
        high=20.0,
        typical=1.5,
        null=1.0,
    )
    peaks: float = parameter(
        "factor on the peaks per mm",
        low=0.05,
        high=20.0,
        typical=1.0,
        null=1.0,
        grid=(0.5, 1.0, 2.0),
    )

    def changed(self, law: Law, view: View) -> Law:
        """Scale the speckle's gain and the distance of its control points."""
        speckle = law.speckle
        if speckle is not None and self.peaks != 1.0:
            speckle = replace(
                speckle,
                cell_x_mm=speckle.cell_x_mm / self.peaks,
                cell_y_mm=speckle.cell_y_mm / self.peaks,
            )
        return replace(law, speckle=speckle, speckle_gain=law.speckle_gain * self.amplitude)
