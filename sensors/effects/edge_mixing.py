"""Mixed readings at depth edges: the line is cut, or lies on two levels at once."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import Effect
from sensors.effects.line_width import line_sd, rayleigh
from sensors.effects.parameter import parameter
from sensors.law import Law
from sensors.line.beam import Beam
from sensors.line.line_operator import gaussian_weights, line_sd_mm, read_line, sub_lines
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class EdgeMixing(Effect):
    """What the centre of a partly hidden or divided line reads, beyond its footprint's mean."""

    name: ClassVar = "edge_mixing"
    summary: ClassVar = (
        "At a depth edge the camera sees part of the line only, or two lines: readings lean to "
        "the camera's side or lie between the levels."
    )
    equation: ClassVar = (
        "z_m = Σ L V [z + κ η cot θ] / Σ L V less Σ L z / Σ L; half a line: κ · 0.80 s cot θ"
    )
    source: ClassVar = (
        "Centre of gravity of a Gaussian line, sensors/line/line_operator.py; "
        "Siegman, Lasers (1986), "
        "ch. 17 for the beam's width away from focus; half-normal mean √(2/π) s"
    )
    statement: ClassVar = (
        "Beside depth edges, within twice the line's width, readings are off because only part of"
        " the laser line (standard deviation {line_sd_um:.0f} µm) is seen there, or two levels at"
        " once."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "edge_y"
    rivals: ClassVar = ("finite_spot", "camera_occlusion", "reflectance_edge")
    separating: ClassVar = (
        "turn the sensor by 180° about the laser's axis: the error at an edge changes its sign; "
        "rounding by the footprint doesn't"
    )
    needs: ClassVar = ("triangulation_angle_deg",)
    line_width: ClassVar = "line_sd_um"

    line_sd_um: float | None = line_sd()
    merge_um: float = parameter(
        "depth between two peaks up to which they merge; beyond, the brighter wins",
        unit="µm",
        low=0.0,
        high=100000.0,
        typical=500.0,
        fixed=True,
    )
    weakest: float = parameter(
        "share of the line's light that makes a peak; with less the reading is left alone",
        low=0.0,
        high=1.0,
        typical=0.2,
    )
    rayleigh_mm: float = rayleigh()

    def stated_on(self, beam: Beam) -> Beam:
        """State how edges mix readings, and which levels merge."""
        return replace(
            beam,
            cut=beam.cut if self.is_null else self,
            merge_um=max(beam.merge_um, self.merge_um),
        )

    def as_told(self) -> Self:
        """Return the effect as it is: its figures are those that were measured."""
        return self

    def changed(self, law: Law, view: View) -> Law:
        """Add what cutting and doubling the line does; nothing where the line is whole."""
        return replace(law, mean_mm=law.mean_mm + self.shift(view))

    def shift(self, view: View) -> NDArray[np.float64]:
        """Return what the cut or doubled line reads, less its footprint's mean."""
        sd = line_sd_mm(view, self.line_sd_um, self.rayleigh_mm)
        offsets = sub_lines(float(np.max(sd)))
        weights = gaussian_weights(offsets, sd)
        seen = read_line(
            view, offsets, weights, camera=True, visible=True, merge_mm=self.merge_um * 1e-3
        )
        base = np.where(np.isfinite(seen.spot_mm), seen.spot_mm, view.depth_mm)
        mixed = np.isfinite(seen.depth_mm) & ~seen.whole & (seen.light >= self.weakest)
        return np.where(mixed, seen.depth_mm - base, 0.0)
