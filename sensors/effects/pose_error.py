"""Mounting error: the sensor is rotated and displaced relative to its commanded pose."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sensors.effects.base import MotionEffect
from sensors.effects.parameter import parameter
from sensors.view.rigid import rigid_jacobian
from sensors.view.view import View

Floats = NDArray[np.float64]


def _rotation(axis: str) -> Any:
    return parameter(
        f"rotation about {axis}",
        unit="°", low=-5.0, high=5.0, typical=0.1, null=0.0, linear=True,
    )  # fmt: skip


def _displacement(axis: str) -> Any:
    return parameter(
        f"displacement along {axis}",
        unit="mm", low=-20.0, high=20.0, typical=0.0, null=0.0, linear=True,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class PoseError(MotionEffect):
    """A rigid error of the mounting, the same in every profile and recording."""

    name: ClassVar = "pose_error"
    summary: ClassVar = (
        "The sensor's true pose differs from the commanded one: all readings are rotated or "
        "displaced."
    )
    equation: ClassVar = "pose_true = pose · T(x, y, z) Rz(yaw) Ry(roll) Rx(pitch)"
    source: ClassVar = (
        "Rigid error of the hand-eye calibration, 0.05 to 0.5°; first order δz = -n·(t + ω × p) /"
        " (n·d)"
    )
    statement: ClassVar = (
        "The sensor's mounting differs from the commanded pose: roll {roll_deg:.3f}°, pitch "
        "{pitch_deg:.3f}°, yaw {yaw_deg:.3f}°, offsets {x_mm:.3f}, {y_mm:.3f}, {z_mm:.3f} mm."
    )
    channels: ClassVar = ("mean", "missing")
    frame: ClassVar = "sensor"
    covariate: ClassVar = "x"
    rivals: ClassVar = ("lens_distortion", "incidence_bias", "volume_scattering")
    separating: ClassVar = (
        "scan a sphere or a stepped artefact in several orientations and solve for the mounting"
    )

    roll_deg: float = _rotation("the travel (sensor y)")
    pitch_deg: float = _rotation("the laser line (sensor x)")
    yaw_deg: float = _rotation("the laser's axis (sensor z)")
    x_mm: float = _displacement("the line")
    y_mm: float = _displacement("the travel")
    z_mm: float = _displacement("the laser's axis")

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the first order for each rotation and displacement."""
        push = rigid_jacobian(view)
        turn = math.radians(1.0)
        return turn * push[4], turn * push[3], turn * push[5], push[0], push[1], push[2]

    def moved(self, view: View) -> View:
        """Return the view from the true poses."""
        angles = [math.radians(a) for a in (self.yaw_deg, self.roll_deg, self.pitch_deg)]
        error = np.eye(4)
        error[:3, :3] = Rotation.from_euler("ZYX", angles).as_matrix()
        error[:3, 3] = self.x_mm, self.y_mm, self.z_mm
        return view.posed(view.poses @ error)
