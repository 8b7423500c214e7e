"""The surface is rougher or smoother than its figures say."""

from dataclasses import dataclass, replace
from typing import ClassVar

from sensors.effects.base import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class RoughnessLevel(Effect):
    """Factors on the speckle's height and on its number of peaks."""

    name: ClassVar = "roughness_level"
    summary: ClassVar = "The noise is stronger or finer everywhere than the surface's figures say."
    equation: ClassVar = "heights × amplitude, peaks per mm × peaks"
    source: ClassVar = (
        "Amplitude and control points of the Perlin model, Sensors 2023, 23, 7624, section 2.2.2"
    )
    statement: ClassVar = (
        "The surface's noise is {amplitude:.2f} times as strong and has {peaks:.2f} times as many"
        " peaks per mm as its figures say."
    )
    channels: ClassVar = ("variance", "correlation")
    frame: ClassVar = "part"
    covariate: ClassVar = "part_x"
    relaxed: ClassVar = (
        Relaxed(channel="scale"),
        Relaxed(channel="scale", along=("part_x", "part_y", "part_z")),
    )
    rivals: ClassVar = ("incidence_noise", "anisotropic_lay")
    separating: ClassVar = (
        "scan a plate of the same finish flat: this level holds everywhere, incidence noise on "
        "slopes"
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
