"""An albedo edge across the line biases its centroid towards the brighter side."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from sensors.effects.effect import Effect
from sensors.effects.line_width import along, line_sd, rayleigh
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.line.beam import Beam
from sensors.line.line_operator import centroid_bias_mm, line_sd_mm
from sensors.line.recorded_brightness import recorded_bias_mm
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class ReflectanceEdge(Effect):
    """Centroid bias of the line by its brightness; needs a reflectance or an intensity.

    A part's reflectance is averaged over the footprint along the line. A recorded intensity is an
    average over that footprint already.
    """

    name: ClassVar = "reflectance_edge"
    summary: ClassVar = (
        "Where the surface's albedo changes across the line, the line's centroid is biased towards "
        "the brighter side; triangulation turns the bias into depth."
    )
    equation: ClassVar = (
        "κ s √(2/π) (1-r)/(1+r) cot θ at an edge of brightness ratio r, times s/√(s² + w² tan² φ) "
        "for an edge at the angle φ to the line and a footprint w along the line; "
        "κ s² cot θ ∂y ln I in a gradient"
    )
    source: ClassVar = (
        "Centre of gravity of a Gaussian line, sensors/line/line_operator.py and, of a recorded "
        "brightness, sensors/line/recorded_brightness.py; "
        "Siegman, Lasers (1986), "
        "ch. 17 for the beam's width away from focus; Buzinski, Levine, Stevenson, Proc. SPIE "
        "1661 (1992) on reflectance edges in triangulation"
    )
    statement: ClassVar = (
        "At albedo edges (ink, stains, machining marks) the depth shows a false ridge or groove, "
        "as a line of {line_sd_um:.0f} µm (standard deviation) predicts."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "brightness_slope"
    on_albedo: ClassVar = True
    relaxed: ClassVar = (Relaxed(channel="mean", spanned=True),)
    rivals: ClassVar = ("edge_mixing", "form_error")
    separating: ClassVar = (
        "compare with the intensity image, and turn the sensor by 180°: true relief keeps its "
        "sign, the bias changes its sign"
    )
    needs: ClassVar = ("triangulation_angle_deg",)

    line_sd_um: float | None = line_sd()
    along_um: float = along("; 0: that of the listed `finite_spot`")
    rayleigh_mm: float = rayleigh()

    def stated_on(self, beam: Beam) -> Beam:
        """State the footprint along the line."""
        return replace(beam, along_um=max(beam.along_um, self.along_um))

    def variants(self, view: View) -> tuple[Self, ...]:
        """Return the line with a footprint of a column's width, where none is stated."""
        if view.reflectance is None or self.along_um or view.sensor.beam.along_um:
            return ()
        pitch_mm = float(np.median(np.abs(np.diff(view.column_x_mm))))
        return (self.with_parameters(along_um=1e3 * pitch_mm / math.sqrt(12.0)),)

    def changed(self, law: Law, view: View) -> Law:
        """Add the centroid bias; zero where no brightness is known.

        Where a border lies within the line, a pattern drawn in wider cells can't tell; what the
        line reads of both levels does.
        """
        if view.intensity is None and view.reflectance is None:
            return law
        sd = line_sd_mm(view, self.line_sd_um, self.rayleigh_mm)
        drawn = view.reflectance
        if view.intensity is not None and (drawn is None or np.max(sd) < drawn.cell_mm):
            return law.biased(recorded_bias_mm(view, sd))
        along = 1e-3 * (self.along_um or view.sensor.beam.along_um)
        return law.biased(centroid_bias_mm(view, sd, along_mm=along))
