"""Occlusion: no reading where the part hides the laser spot from the camera."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.line.beam import Beam
from sensors.line.line_operator import gaussian_weights, read_line, sub_lines
from sensors.view.covariates import hidden_from
from sensors.view.view import KEPT_IN_ALL, KEPT_WIDTHS, Reason, View
from sensors.view.view_cache import ViewCache

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraOcclusion(Effect):
    """Readings are missing where a camera at (0, κ b, 0) is occluded, b = WD tan θ."""

    name: ClassVar = "camera_occlusion"
    summary: ClassVar = (
        "Readings are missing where the part blocks the line of sight from laser spot to camera."
    )
    equation: ClassVar = "missing where the segment from (x, 0, z) to (0, κ b, 0) meets the part"
    source: ClassVar = (
        "Geometry of triangulation; a step of height h casts a shadow of length h tan θ, "
        "h b / z on the floor of a push-broom scan"
    )
    statement: ClassVar = (
        "Steps and walls occlude the camera: readings are missing on one side of each. A camera "
        "{triangulation_angle_deg:.1f}° from the laser predicts these shadows."
    )
    channels: ClassVar = ("missing",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "hidden"
    relaxed: ClassVar = (Relaxed(channel="missing", spanned=True),)
    rivals: ClassVar = ("specular_dropout", "random_dropout")
    line_width: ClassVar = "line_sd_um"
    least_light: ClassVar = "weakest"
    separating: ClassVar = (
        "turn the part or the sensor by 180° about the laser's axis: shadows change sides on the "
        "part; dropouts at low signal do not"
    )

    triangulation_angle_deg: float | None = parameter(
        "angle between laser and camera at the working distance; 0: no occlusion",
        unit="°",
        low=0.0,
        high=75.0,
        typical=30.0,
        null=0.0,
        sheet="triangulation_angle_deg",
        grid=(10.0, 15.0, 20.0, 25.0, 30.0, 37.0, 45.0),
    )
    camera_side: str | None = parameter(
        "side of the camera along the travel",
        choices=("+y", "-y"),
        sheet="camera_side",
        typical="+y",
    )

    line_sd_um: float = parameter(
        "standard deviation of the line across its width; 0: only its middle must be visible",
        unit="µm",
        low=0.0,
        high=500.0,
        typical=0.0,
    )
    weakest: float = parameter(
        "smallest visible share of the line's light that still gives a reading, for a line with a "
        "width",
        low=0.001,
        high=0.99,
        typical=0.5,
    )

    def stated_on(self, beam: Beam) -> Beam:
        """State the share of light that makes a peak, for a line with a width."""
        if self.line_sd_um == 0.0:
            return beam
        return replace(beam, weakest=max(beam.weakest, self.weakest))

    def variants(self, view: View) -> tuple[Self, ...]:
        """Return the camera on the other side."""
        side = self.camera_side or view.datasheet.camera_side
        return (self.with_parameters(camera_side="+y" if side == "-y" else "-y"),)

    def changed(self, law: Law, view: View) -> Law:
        """Remove the readings whose point is hidden from the camera."""
        offset = self.camera_y_mm(view)
        if self.line_sd_um == 0.0:
            seen = view.visible_from(offset)
        else:
            seen = _light(view, self.line_sd_um * 1e-3, offset) >= self.weakest
        return law.without(view.in_range & ~seen, Reason.HIDDEN_FROM_CAMERA)

    def covariate_values(self, view: View) -> Floats:
        """Return 1 where the point is hidden from the effect's camera, else 0, (n, m)."""
        return hidden_from(view, self.camera_y_mm(view))

    def camera_y_mm(self, view: View) -> float:
        """Return the camera's place along the sensor's y, mm.

        Raises
        ------
        RecipeError
            Where neither the effect nor the datasheet states the angle.
        """
        sheet = view.datasheet
        if self.triangulation_angle_deg is None:
            offset = abs(sheet.camera_offset_mm)
        else:
            angle_rad = math.radians(self.triangulation_angle_deg)
            offset = sheet.working_distance_mm * math.tan(angle_rad)
        side = sheet.camera_side if self.camera_side is None else self.camera_side
        return -offset if side == "-y" else offset


_LIGHT: ViewCache[Floats] = ViewCache(KEPT_WIDTHS, room=KEPT_IN_ALL)


def _light(view: View, sd_mm: float, camera_y_mm: float) -> Floats:
    """Share of a line's light that a camera sees, (n, m); kept with the view.

    It has nothing to do with what other effects read, nor with how little makes a peak.
    """

    def light() -> Floats:
        lines = sub_lines(sd_mm)
        weights = gaussian_weights(lines, sd_mm)
        read = read_line(view, lines, weights, visible=True, merge_mm=0.0, camera_y_mm=camera_y_mm)
        return read.light

    return _LIGHT.get(view, (sd_mm, camera_y_mm), light, size=math.prod(view.shape))
