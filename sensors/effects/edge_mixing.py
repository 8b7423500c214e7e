"""Mixed readings at depth edges: the line is partly hidden, or lies on two levels."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.line_width import line_sd, rayleigh
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.line.beam import Beam
from sensors.line.line_operator import gaussian_weights, line_sd_mm, read_line, sub_lines
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class EdgeMixing(Effect):
    """Centroid of a partly hidden or divided line, minus its footprint's mean."""

    name: ClassVar = "edge_mixing"
    summary: ClassVar = (
        "At a depth edge the camera sees only part of the line, or two lines: readings are biased "
        "towards the camera's side or lie between the levels."
    )
    equation: ClassVar = (
        "z_m = Σ L V [z + κ η cot θ] / Σ L V - Σ L z / Σ L; half a line: κ · 0.80 s cot θ"
    )
    source: ClassVar = (
        "Centre of gravity of a Gaussian line, sensors/line/line_operator.py; "
        "Siegman, Lasers (1986), "
        "ch. 17 for the beam's width away from focus; half-normal mean √(2/π) s"
    )
    statement: ClassVar = (
        "Within twice the line's width of depth edges, readings are biased: the camera sees only"
        " part of the laser line (standard deviation {line_sd_um:.0f} µm), or two levels at once."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "edge_y"
    relaxed: ClassVar = (Relaxed(channel="mean", spanned=True),)
    rivals: ClassVar = ("finite_spot", "camera_occlusion", "reflectance_edge")
    separating: ClassVar = (
        "turn the sensor by 180° about the laser's axis: the error at an edge changes its sign; "
        "rounding by the footprint does not"
    )
    needs: ClassVar = ("triangulation_angle_deg",)
    line_width: ClassVar = "line_sd_um"

    line_sd_um: float | None = line_sd()
    merge_um: float = parameter(
        "largest depth between two peaks that merge; of peaks farther apart the brighter is read",
        unit="µm",
        low=0.0,
        high=100000.0,
        typical=500.0,
        fixed=True,
    )
    weakest: float = parameter(
        "smallest share of the line's light that makes a peak; the effect changes no reading with "
        "less",
        low=0.0,
        high=1.0,
        typical=0.2,
    )
    rayleigh_mm: float = rayleigh()

    def stated_on(self, beam: Beam) -> Beam:
        """State the effect and the depth between levels that merge."""
        return replace(
            beam,
            cut=beam.cut if self.is_null else self,
            merge_um=max(beam.merge_um, self.merge_um),
        )

    def as_measured(self) -> Self:
        """Return the effect unchanged: its values were measured with the file's line."""
        return self

    def changed(self, law: Law, view: View) -> Law:
        """Add the bias of a cut or doubled line; zero where the line is whole."""
        return law.biased(self.shift(view))

    def shift(self, view: View) -> NDArray[np.float64]:
        """Return the cut or doubled line's centroid minus its footprint's mean."""
        sd = line_sd_mm(view, self.line_sd_um, self.rayleigh_mm)
        offsets = sub_lines(float(np.max(sd)))
        weights = gaussian_weights(offsets, sd)
        seen = read_line(
            view, offsets, weights, camera=True, visible=True, merge_mm=self.merge_um * 1e-3
        )
        base = np.where(np.isfinite(seen.spot_mm), seen.spot_mm, view.depth_mm)
        mixed = np.isfinite(seen.depth_mm) & ~seen.whole & (seen.light >= self.weakest)
        return np.where(mixed, seen.depth_mm - base, 0.0)
