"""Surface lay: the roughness has a direction (grinding or rolling marks)."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class AnisotropicLay(Effect):
    """The speckle's spectrum is elliptic, with axes fixed to the part."""

    name: ClassVar = "anisotropic_lay"
    summary: ClassVar = (
        "The noise is anisotropic: longer correlated along the part's lay (grinding, rolling, "
        "milling marks)."
    )
    equation: ClassVar = "correlation length √ratio longer along the lay, √ratio shorter across it"
    source: ClassVar = (
        "Elliptic spectrum of surfaces with lay, ISO 25178-2 texture aspect ratio Str = 1/ratio; "
        "ratio 2 to 10"
    )
    statement: ClassVar = (
        "The surface has a lay: the noise is correlated {ratio:.1f} times longer along "
        "{angle_deg:.0f}° (from the part's x towards its y) than across."
    )
    channels: ClassVar = ("correlation", "variance")
    frame: ClassVar = "part"
    covariate: ClassVar = "part_x"
    rivals: ClassVar = ("column_offset", "roughness_level")
    separating: ClassVar = "rotate the part by 90°: lay turns with the part, column offsets do not"

    ratio: float = parameter(
        "correlation length along the lay over that across",
        low=1.0,
        high=50.0,
        typical=4.0,
        null=1.0,
        grid=(2.0, 4.0, 8.0),
    )
    angle_deg: float = parameter(
        "direction of the lay in the part's x-y plane, from x towards y",
        unit="°",
        low=-180.0,
        high=180.0,
        typical=0.0,
        grid=(0.0, 45.0, 90.0, 135.0),
    )

    amplitude: float = parameter(
        "factor on the speckle by the ridges of the lay",
        low=1.0,
        high=20.0,
        typical=1.0,
    )

    def changed(self, law: Law, view: View) -> Law:
        """Stretch the speckle along the lay in the middle profile's sensor frame, and scale it."""
        angle = math.radians(self.angle_deg)
        along = np.array([math.cos(angle), math.sin(angle), 0.0])
        seen = view.poses[len(view.poses) // 2, :3, :3].T @ along
        turned = math.atan2(seen[1], seen[0])
        return replace(
            law,
            lay_ratio=law.lay_ratio * self.ratio,
            lay_angle_rad=turned,
            speckle_gain=law.speckle_gain * self.amplitude,
        )
