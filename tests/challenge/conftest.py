"""A small instrument and simple targets for the tests of the virtual instrument."""

from dataclasses import replace
from math import atan, radians

import numpy as np
import pytest

from challenge.instrument.calibration import CalibrationPlan
from challenge.instrument.camera import Camera
from challenge.instrument.frames import Faults
from challenge.instrument.instrument import Instrument, Path, Solid
from challenge.instrument.motion import Motion
from challenge.instrument.peaks import PeakFinder
from challenge.instrument.sheet import LaserSheet

DISTANCE = 150.0


def strip(z_of_x, *, half_x=15.0, half_y=60.0, points=3, slope_y=0.0, end_y=None):
    """Open strip ``z(x) + slope_y y`` facing the sensor."""
    x = np.linspace(-half_x, half_x, points)
    z = np.broadcast_to(z_of_x(x) if callable(z_of_x) else z_of_x, x.shape)
    far_y = half_y if end_y is None else end_y
    near = np.stack([x, np.full(points, -half_y), z - slope_y * half_y], 1)
    far = np.stack([x, np.full(points, far_y), z + slope_y * far_y], 1)
    i = np.arange(points - 1)
    faces = np.concatenate(
        [
            np.stack([i, i + points, i + 1], 1),
            np.stack([i + 1, i + points, i + points + 1], 1),
        ]
    )
    return Solid(vertices_mm=np.concatenate([near, far]), faces=faces)


def path(profiles, pitch_mm, *, start_y=0.0, rate_hz=100.0):
    """Straight scan along +y from ``start_y``."""
    start = np.eye(4)
    start[1, 3] = start_y
    return Path(
        start=start,
        direction=1,
        profiles=profiles,
        pitch_mm=pitch_mm,
        rate_hz=rate_hz,
        start_s=0.0,
    )


@pytest.fixture(scope="session")
def instrument():
    """Build a good instrument: 160 columns, 0.1 mm apart, at 150 mm."""
    camera = Camera(
        working_distance_mm=DISTANCE,
        triangulation_rad=radians(30),
        side=1,
        columns=160,
        fov_rad=2 * atan(16 / 2 / DISTANCE),
        rows=128,
        row_pitch_mm=0.05,
    )
    return Instrument(
        sheet=LaserSheet(waist_mm=0.05, waist_z_mm=DISTANCE, exposure_s=1e-5),
        camera=camera,
        finder=PeakFinder(kind="gravity", threshold=0.01, fraction_bits=10),
        faults=Faults(),
        motion=Motion(),
        plan=CalibrationPlan(),
        z_range_mm=10.0,
        step_mm=1e-4,
    )


@pytest.fixture(scope="session")
def calibrated(instrument):
    """Calibrate the good instrument on its own target."""
    return instrument.calibrated(np.random.default_rng(5))


@pytest.fixture(scope="session")
def faultless(instrument):
    """Take away what hides the optics: no noise but speckle, no threshold to speak of."""
    camera = replace(
        instrument.camera, read_noise_e=0.5, ambient_e=0.0, full_well_e=1e7, fill=0.05, bits=14
    )
    return replace(
        instrument,
        camera=camera,
        finder=PeakFinder(kind="gravity_all", threshold=5e-4, fraction_bits=14),
    )
