"""A small instrument for the tests of the virtual instrument."""

from dataclasses import replace
from math import atan, radians

import numpy as np
import pytest

from challenge.instrument.calibration import CalibrationPlan
from challenge.instrument.camera import Camera
from challenge.instrument.frames import Faults
from challenge.instrument.instrument import Instrument
from challenge.instrument.motion import Motion
from challenge.instrument.peaks import PeakFinder
from challenge.instrument.sheet import LaserSheet
from tests.support.optical_targets import DISTANCE


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
