"""Lateral calibration error: readings lie beside their stated x."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.casting.laser import Laser
from sensors.effects.base import MotionEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.view.covariates import shift_x
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class LateralError(MotionEffect):
    """An offset, a scale and a scale that changes with range, of x.

    δx is linear in z along each ray, so the true ray is straight. The part is cast along the true
    ray, and nothing is linearised at edges.
    """

    name: ClassVar = "lateral_error"
    summary: ClassVar = (
        "The points of a profile lie beside their stated x: depths on slopes along the line are "
        "biased, edges and holes are displaced."
    )
    equation: ClassVar = (
        "δx = offset + scale u + shear u w, u = x/(x_fov/2) and w = (z - WD)/(z_range/2); "
        "δz = δx dz/dx on a slope"
    )
    source: ClassVar = (
        "Lowest orders of a residual calibration of x over (x, z): magnification and its change "
        "with range of a tilted image plane (Scheimpflug); 5 to 100 µm"
    )
    statement: ClassVar = (
        "Points lie beside their stated x by {offset_um:.0f} µm throughout, {scale_um:.0f} µm "
        "more at the ends of the line and {shear_um:.0f} µm more at its far corners."
    )
    channels: ClassVar = ("mean",)
    secondary_channels: ClassVar = ("missing",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "slope_x"
    relaxed: ClassVar = (Relaxed(channel="mean", along=("x",), times="shift_x"),)
    rivals: ClassVar = ("lens_distortion", "pose_error", "incidence_bias")
    separating: ClassVar = (
        "scan a plate tilted along the line, then tilted the other way: an error of x changes "
        "its sign, an error of depth does not"
    )

    offset_um: float = parameter(
        "constant error of x; not identifiable where the part's position is estimated",
        unit="µm",
        low=-2000.0,
        high=2000.0,
        typical=0.0,
        null=0.0,
        linear=True,
        fixed=True,
    )
    scale_um: float = parameter(
        "error of x at the ends of the line: a scale error of the pitch",
        unit="µm",
        low=-2000.0,
        high=2000.0,
        typical=50.0,
        null=0.0,
        linear=True,
    )
    shear_um: float = parameter(
        "further error of x at the ends of the line and of the range",
        unit="µm",
        low=-2000.0,
        high=2000.0,
        typical=20.0,
        null=0.0,
        linear=True,
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the slope along the line times δx of each parameter: first order in δx."""
        along = self._along(view)
        away = (view.depth_mm - view.datasheet.working_distance_mm) / self._half_range_mm(view)
        slope = 1e-3 * shift_x(view)
        return slope, slope * along, slope * along * away

    def moved(self, view: View) -> View:
        """Return the view along the true rays."""
        offset, scale, shear = (1e-3 * v for v in (self.offset_um, self.scale_um, self.shear_um))
        along = self._along(view)
        turned = shear * along / self._half_range_mm(view)
        laser = Laser(
            x_mm=view.laser.x_mm
            + offset
            + scale * along
            - turned * view.datasheet.working_distance_mm,
            slope_x=view.laser.slope_x + turned,
        )
        return view.along(laser)

    def _along(self, view: View) -> Floats:
        return np.asarray(view.column_off_axis_mm / (view.datasheet.x_fov_mm / 2))

    def _half_range_mm(self, view: View) -> float:
        return view.datasheet.z_range_mm / 2
