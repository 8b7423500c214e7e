"""Shadows: no return where the part stands between the laser's spot and the camera."""

import math
from dataclasses import dataclass
from typing import ClassVar

from sensors.effects.base import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law
from sensors.view import Reason, View


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraOcclusion(Effect):
    """The camera at (0, κ b, 0), b = working distance · tan θ, must see the point."""

    name: ClassVar = "camera_occlusion"
    summary: ClassVar = (
        "No return where the sight line from the laser's spot to the camera meets the part."
    )
    equation: ClassVar = "missing where the segment from (x, 0, z) to (0, κ b, 0) meets the part"
    source: ClassVar = (
        "Geometry of triangulation; shadow length h tan θ beside a step of height h, "
        "h b / z of the floor in a push-broom scan"
    )
    statement: ClassVar = (
        "The camera can't see the laser line beside steps and walls: points are missing on one "
        "side of them, as a camera {triangulation_angle_deg:.1f}° from the laser would have it."
    )
    channels: ClassVar = ("missing",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "hidden"
    rivals: ClassVar = ("specular_dropout", "random_dropout")
    separating: ClassVar = (
        "turn the part or the sensor by 180° about the laser's axis: shadows change sides on the "
        "part; dropouts by low signal stay"
    )

    triangulation_angle_deg: float | None = parameter(
        "angle between laser and camera at the working distance; 0 sees all that the laser hits",
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

    def changed(self, law: Law, view: View) -> Law:
        """Take the return away where the camera doesn't see the point."""
        sheet = view.datasheet
        if self.triangulation_angle_deg is None and self.camera_side is None:
            seen = view.visible
        else:
            angle_deg = self.triangulation_angle_deg
            if angle_deg is None:
                angle_deg = sheet.require("triangulation_angle_deg")
            side = sheet.camera_side if self.camera_side is None else self.camera_side
            offset = sheet.working_distance_mm * math.tan(math.radians(angle_deg))
            seen = view.visible_from(offset if side == "+y" else -offset)
        return law.without(view.valid & ~seen, Reason.HIDDEN_FROM_CAMERA)
