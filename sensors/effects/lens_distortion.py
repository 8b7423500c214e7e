"""Residual lens distortion: errors that grow towards the corners of the field."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import AdditiveEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class LensDistortion(AdditiveEffect):
    """The cross term of x and range and the third order of x."""

    name: ClassVar = "lens_distortion"
    summary: ClassVar = "Depths are distorted towards the corners of the field of view."
    equation: ClassVar = "a3 x (z - WD) + a4 x³, given by their values at the field's corner"
    source: ClassVar = (
        "Lowest odd orders of a residual lens distortion over (x, z), Brown, Photogramm. Eng. 37 "
        "(1971) 855; 5 to 100 µm"
    )
    statement: ClassVar = (
        "The depth is distorted towards the ends of the line: {tilt_um:.0f} µm at the far corner "
        "growing with range, and {cubic_um:.0f} µm as the cube of the position."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "x"
    relaxed: ClassVar = (Relaxed(channel="mean", along=("x", "depth")),)
    rivals: ClassVar = ("form_error", "line_bow", "pose_error", "range_scale")
    separating: ClassVar = (
        "shift the part in x and in range: the error stays with the field of view"
    )

    tilt_um: float = parameter(
        "error of a3 x (z - WD) at the end of the line and of the range",
        unit="µm",
        low=-1000.0,
        high=1000.0,
        typical=20.0,
        null=0.0,
        linear=True,
    )
    cubic_um: float = parameter(
        "error of a4 x³ at the end of the line",
        unit="µm",
        low=-1000.0,
        high=1000.0,
        typical=20.0,
        null=0.0,
        linear=True,
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the cross term and the cube, each one at the corner +x, far."""
        sheet = view.datasheet
        x = view.off_axis_mm / (sheet.x_fov_mm / 2)
        z = (view.depth_mm - sheet.working_distance_mm) / (sheet.z_range_mm / 2)
        return 1e-3 * x * z, 1e-3 * x**3
