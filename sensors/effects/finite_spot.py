"""The laser line has a width: each reading is an average over its footprint."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.line_width import along, line_sd, rayleigh
from sensors.effects.parameter import Parameter, parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.line.beam import Beam, listed_sd_mm, wider_mm
from sensors.line.line_operator import (
    centroid_bias_mm,
    gaussian_weights,
    line_sd_mm,
    read_line,
    sub_lines,
)
from sensors.view.view import KEPT_IN_ALL, KEPT_WIDTHS, View
from sensors.view.view_cache import ViewCache

_ROUNDED: ViewCache[NDArray[np.float64]] = ViewCache(KEPT_WIDTHS, room=KEPT_IN_ALL)
TIMES_WIDER = (0.5, 1.4, 2.0, 2.8)
"""Starting widths of a search, over the width of the line that the file states."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FiniteSpot(Effect):
    """Mean depth over a Gaussian footprint on the surface that continues from the centre.

    The file's values at edges were measured with the line width of that time. Where the line width
    has increased since (`beam_um`), the reading changes by the difference between the readings of
    a matt surface under both widths.
    """

    name: ClassVar = "finite_spot"
    summary: ClassVar = (
        "Each reading averages the depth over the laser line's width: edges are rounded, and "
        "curved surfaces are biased."
    )
    equation: ClassVar = (
        "z_m = Σ L(η) z(y+η) / Σ L(η), bias about s²/2 · ∂²z/∂y²; with `lean`, + lean · "
        "(Σ L I [z + κ η cot θ] / Σ L I - Σ L [z + κ η cot θ] / Σ L), I the brightness"
    )
    source: ClassVar = (
        "Centre of gravity of a Gaussian line, sensors/line/line_operator.py; "
        "Siegman, Lasers (1986), "
        "ch. 17 for the beam's width away from focus"
    )
    statement: ClassVar = (
        "Edges and small radii are rounded as a laser line of {line_sd_um:.0f} µm (standard "
        "deviation across its width) predicts."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "curvature_y"
    relaxed: ClassVar = (Relaxed(channel="mean", spanned=True),)
    rivals: ClassVar = ("motion_blur", "edge_mixing")
    line_width: ClassVar = "line_sd_um"
    separating: ClassVar = (
        "rotate the part by 90°: rounding by the line's width stays along the travel; vary the "
        "speed: motion blur grows with the speed"
    )

    line_sd_um: float | None = line_sd()
    along_um: float = along()
    rayleigh_mm: float = rayleigh()

    lean: float = parameter(
        "centroid bias towards the brighter side of a crease, over that of a line this wide, "
        "where the brightness is known",
        low=0.0,
        high=1.0,
        typical=0.0,
    )

    beam_um: float = parameter(
        "current standard deviation of the line, where the file's values at edges were measured "
        "with another line width; 0: unchanged",
        unit="µm",
        low=0.0,
        high=500.0,
        typical=0.0,
    )

    def searched(self, *, linear: bool | None = None) -> tuple[Parameter, ...]:
        """Return the free parameters: values measured for the file stay fixed."""
        found = Effect.searched(self, linear=linear)
        return tuple(p for p in found if (p.name == "beam_um") == (self.beam_um > 0))

    def grid(self, view: View) -> tuple[Self, ...]:
        """Return wider and narrower lines than the listed one; any line where none is listed."""
        if self != view.sensor.beam.spot:
            return Effect.grid(self, view)
        beam_um, high = 1e3 * listed_sd_mm(view), self.parameter("beam_um").high
        wide = [min(beam_um * times, high) for times in TIMES_WIDER]
        return tuple(self.with_parameters(beam_um=um) for um in wide)

    def stated_on(self, beam: Beam) -> Beam:
        """State the width, how it rounds readings, and the footprint along the line."""
        return replace(
            beam,
            spot=beam.spot if self.is_null else self,
            sd_um=max(beam.sd_um, self.beam_um),
            along_um=max(beam.along_um, self.along_um),
        )

    def as_measured(self) -> Self:
        """Return the spot with the line width at which the file's values were measured."""
        return self.with_parameters(beam_um=0.0)

    def words(self) -> dict[str, float]:
        """Return the current line width for the statement."""
        return {"line_sd_um": self.beam_um} if self.beam_um else {}

    def variants(self, view: View) -> tuple[Self, ...]:
        """Return the line with a centroid bias, where the brightness is known."""
        placed = view.datasheet.triangulation_angle_deg is not None
        if self.beam_um or view.brightness is None or not placed:
            return ()
        return (self.with_parameters(lean=0.3),)

    def changed(self, law: Law, view: View) -> Law:
        """Add the difference between the footprint's mean and the depth at its centre."""
        return law.biased(self.shift(view))

    def shift(self, view: View) -> NDArray[np.float64]:
        """Return the footprint's mean minus the centre's depth, a wider line's change included."""
        measured = self.as_measured()
        rounded = _ROUNDED.get(
            view, measured, lambda: measured._rounded(view), size=math.prod(view.shape)
        )
        return rounded + wider_mm(view, 1e-3 * self.beam_um) if self.beam_um else rounded

    def _rounded(self, view: View) -> NDArray[np.float64]:
        sd = line_sd_mm(view, self.line_sd_um, self.rayleigh_mm)
        offsets = sub_lines(float(np.max(sd)))
        line = read_line(view, offsets, gaussian_weights(offsets, sd))
        change = np.where(np.isfinite(line.depth_mm), line.depth_mm - view.depth_mm, 0.0)
        if self.lean > 0 and view.brightness is not None:
            change += self.lean * centroid_bias_mm(view, sd, creases=True)
        if self.along_um > 0:
            offsets = sub_lines(self.along_um * 1e-3)
            weights = gaussian_weights(offsets, self.along_um * 1e-3)
            line = read_line(view, offsets, weights, axis="x")
            change += np.where(np.isfinite(line.depth_mm), line.depth_mm - view.depth_mm, 0.0)
        return change
