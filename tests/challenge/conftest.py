"""A small instrument, and one small case of it, sealed and answered."""

import hashlib
import json
import shutil
from dataclasses import replace
from math import atan, radians

import h5py
import numpy as np
import pytest

from challenge.cases.case import Secret, stage, write
from challenge.instrument.calibration import CalibrationPlan
from challenge.instrument.camera import Camera
from challenge.instrument.frames import Faults
from challenge.instrument.instrument import Instrument
from challenge.instrument.motion import Motion
from challenge.instrument.peaks import PeakFinder
from challenge.instrument.sheet import LaserSheet
from challenge.sets.sealed import seal
from tests.support.answers import answer
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


@pytest.fixture(scope="session")
def bowed(tmp_path_factory):
    """Make one case with a strong bow, small enough for a test."""
    secret = Secret(
        kind="one", switches=("line_bow",), strength=2, shape="terraces", recordings=2, seed=7
    )
    staged = stage(secret)
    folder = tmp_path_factory.mktemp("case")
    write(secret, staged, folder)
    return secret, staged, folder


@pytest.fixture
def judged(tmp_path, bowed):
    """Seal the bow by hand, with an answer written by hand."""
    secret, staged, folder = bowed
    (tmp_path / "keys").mkdir()
    shutil.copytree(folder, tmp_path / "cases" / "case-001")
    key, nonce, digest = seal(secret, {"noise_um": 15.0, "oracle_gain": 0.4, "concealed": True})
    (tmp_path / "keys" / "case-001.key.json").write_bytes(key)
    kept = {"nonce": nonce, "commitment": digest}
    (tmp_path / "keys" / "case-001.seal.json").write_text(json.dumps(kept))
    (tmp_path / "keys" / "master.json").write_text(json.dumps({"seed": 1}))
    files = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}
    public = {"protocol": {}, "cases": {"case-001": {"commitment": digest, "files": files}}}
    (tmp_path / "commitments.json").write_text(json.dumps(public))
    kept_in = tmp_path / "answers" / "case-001"
    kept_in.mkdir(parents=True)
    (kept_in / "run.json").write_text(json.dumps({"code": 0, "seconds": 5.0, "said": ""}))
    (kept_in / "diagnosis.json").write_text(json.dumps(answer("explained", "line_bow")))
    with h5py.File(folder / "b.h5") as file:
        depth = file["depth"][:]
    with h5py.File(kept_in / "mismatch.h5", "w") as out:
        for name, shift in (("a", 0.0), ("b", 0.05)):
            group = out.create_group(name)
            group["mask"] = np.ones(depth.shape, bool)
            group["simulated"] = depth + np.float32(shift)
            group["explained"] = depth + np.float32(shift / 5)
    return tmp_path
