"""Line bow: a residual calibration error quadratic in x."""

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
class LineBow(AdditiveEffect):
    """A parabola over the sensor's x."""

    name: ClassVar = "line_bow"
    summary: ClassVar = "A straight edge along the laser line is read as an arc."
    equation: ClassVar = "a2 x², given by its value at the ends of the line"
    source: ClassVar = "Second order of a residual calibration error over x; 5 to 100 µm"
    statement: ClassVar = (
        "A straight edge along the laser line is read as an arc: {sag_um:.0f} µm off at the ends "
        "of the line against its middle."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "x"
    relaxed: ClassVar = (Relaxed(channel="mean", along=("x",), even=True),)
    rivals: ClassVar = ("form_error", "column_offset", "lens_distortion")
    separating: ClassVar = (
        "shift or turn the part under the sensor: the bow stays with the line, a warp moves with "
        "the part"
    )

    sag_um: float = parameter(
        "depth error at the ends of the line at the working distance",
        unit="µm",
        low=-1000.0,
        high=1000.0,
        typical=30.0,
        null=0.0,
        linear=True,
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the parabola that is one at x = ±x_fov/2 from the axis."""
        return (1e-3 * np.square(view.off_axis_mm / (view.datasheet.x_fov_mm / 2)),)
