"""The rigid Jacobian: change of a depth image with small motions of the sensor."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sensors.view.view import View

Floats = NDArray[np.float64]

GRAZING = 0.17
"""Cosine of incidence below which (80°) the change is held constant."""


def rigid_jacobian(view: "View") -> Floats:
    """Change of depth per displacement t and turn ω of the sensor in its own frame.

    A ray's point p on a facet of normal n moves to p + t + ω × p, and the ray d is followed to
    the facet's plane again: δz = -n·(t + ω × p) / (n·d), d = (dx/dz, 0, 1).

    Returns
    -------
    (6, n, m) array
        Along x, y, z in mm per mm, about x, y, z in mm per rad; NaN at missing readings.
    """
    normal, point = view.normal, view.sensor_mm
    length = np.hypot(1.0, view.laser.slope_x)
    facing = -np.maximum(view.cos_incidence, GRAZING) * length
    turned = np.cross(point, normal)
    push = np.concatenate([normal, turned], axis=-1) / -facing[..., None]
    return np.ascontiguousarray(np.moveaxis(push, -1, 0))
