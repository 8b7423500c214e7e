"""The noise law that a maker of the second family states, against noise measured on plates."""

import numpy as np

from challenge.cases.case import Secret
from challenge.cases.seeds import child
from challenge.second.case import stage
from challenge.second.nominal import noise_on_plane


def test_the_stated_noise_is_that_of_a_plate_which_leans_from_the_camera():
    secret = Secret(kind="null", switches=(), strength=1, shape="waves", recordings=1, seed=5,
                    family="second")  # fmt: skip
    staged = stage(secret)
    device, law = staged.off.device, staged.noise_law
    level = device.way[2] / device.way[1]
    level_mm, leaning_mm = (
        noise_on_plane(device, 0.0, level + lean, 60, child(7, str(lean)))
        for lean in (0.0, -0.6 * device.camera.side)
    )
    stated = (1 + (level - 0.6 * device.camera.side) ** 2) / (1 + level**2)
    stated = stated ** (law.exponent / 2) * np.exp(-0.6 * device.camera.side * law.lean)
    assert law.worst < 0.15
    assert stated < 0.9
    assert abs(leaning_mm / level_mm / stated - 1) < 0.15
