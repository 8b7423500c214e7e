"""How much light of the laser a surface sends towards the camera."""

import math

import numpy as np
from numpy.typing import NDArray

from sensors.view.view import View


def lambertian_light(view: View) -> NDArray[np.float64]:
    """Light towards the camera from a unit of travel, (n, m), 1 for a matt plate facing the laser.

    A tilted facet spreads the laser's power over more surface, and each of its parts sends cos β
    (Lambert, Photometria, 1760) towards the camera, β the angle of its normal to the sight line:
    per unit of travel cos β is left. Times the part's own reflectance where that is stated.
    """
    plate = math.cos(math.radians(view.datasheet.require("triangulation_angle_deg")))
    light = np.fmax(view.cos_camera, 0.0) / plate
    if view.reflectance is not None and view.intensity is None:
        light = light * view.reflectance.at(view.part_mm)
    return np.asarray(light)
