"""Noise of recordings: its size is their own, spikes and losses are the plates'."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.plates import Plate
from diagnosis.model.workspace import Workspace
from diagnosis.noise.calibration import (
    calibrated_noise,
    nominal_noise,
    nominal_sd_mm,
)
from diagnosis.noise.noise_model import calibrate
from diagnosis.settings import SETTINGS
from sensors.law import geometric_law
from sensors.model import SensorModel
from sensors.noise.uncertainty import sigma_mm
from sensors.surface.surface import Surface
from sensors.view.view import View
from tests.support.effect_case import PITCH_MM, bench_workspace
from tests.support.small_parts import datasheet, part, poses


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("domes")


def plate(sd_mm: float, missing: float = 0.0) -> Plate:
    residual = np.random.default_rng(4).normal(0.0, sd_mm, (80, 100))
    view = View(part("plate"), SensorModel(datasheet(100)), poses(80), np.arange(80) / 200.0)
    return Plate(
        residual_mm=residual, view=view, missing_share=missing, pitch_mm=(0.44, PITCH_MM)
    )  # fmt: skip


def test_the_size_is_the_recordings_own(ws: Workspace) -> None:
    own, reference = calibrated_noise(ws.patches, (), [])
    assert reference is None
    residuals = [p.depth_mm - p.plain_mm for p in ws.patches]
    expected = calibrate(
        residuals, [np.isfinite(r) & ~p.edge for r, p in zip(residuals, ws.patches, strict=True)],
        pitch_mm=(0.44, PITCH_MM), missing_share=0.0,
    ).sd_mm  # fmt: skip
    assert own.sd_mm == pytest.approx(expected, rel=0.02)
    assert own.tail_share == 0.0


def test_plates_state_losses_up_to_a_good_instruments(ws: Workspace) -> None:
    notes: list[str] = []
    own, reference = calibrated_noise(ws.patches, (plate(0.02, missing=0.1),), notes)
    assert reference is not None
    assert reference.sd_mm == pytest.approx(0.02, rel=0.05)
    assert own.missing_share == SETTINGS.noise.usual_share
    assert own.sd_mm == calibrated_noise(ws.patches, (), [])[0].sd_mm
    assert notes[0].endswith(f"(ratio {own.sd_mm / reference.sd_mm:.2f})")


def test_the_nominal_noise_is_what_plates_or_the_surface_claim(ws: Workspace) -> None:
    view, own = ws.patches[0].view, ws.noise
    assert nominal_sd_mm(None, None, view) == 0.0
    claimed = replace(own, sd_mm=0.5)
    assert nominal_sd_mm(claimed, None, view) == 0.5
    assert nominal_noise(own, claimed, None, view) is claimed
    rough = Surface(name="rough", rpm_mm=0.02, rvm_mm=0.02, pc_per_mm=1.0)
    rough = rough.ready(0.44, PITCH_MM, z_resolution_um=2.0, repeatability_um=2.0)
    speckle = geometric_law(view, rough).speckle_sd_mm(view)
    expected = np.hypot(sigma_mm(view.datasheet), speckle)
    assert nominal_sd_mm(None, rough, view) == pytest.approx(float(expected))
    assert nominal_noise(own, None, rough, view).sd_mm == pytest.approx(float(expected))


def test_a_plate_that_is_looked_at_askew_is_as_noisy_as_the_file_says(ws: Workspace) -> None:
    # exp(k dz/dy) of the size of the noise on a plane that falls along the travel
    slope, lean = 0.5, 0.4
    sheet = datasheet(100, ({"name": "incidence_noise", "lean": lean, "exponent": 0.0},))
    askew = poses(80, pitch_mm=0.02, tilt_deg=(np.degrees(np.arctan(slope)), 0.0))
    view = View(part("plate"), SensorModel(sheet), askew, np.arange(80) / 200.0)
    grown = np.exp(lean * np.nanmean(view.slope_y))
    noisier = replace(plate(0.02 * grown), view=view)
    _, reference = calibrated_noise(ws.patches, (noisier,), [])
    assert reference is not None
    assert abs(np.nanmean(view.slope_y)) == pytest.approx(slope, rel=0.02)
    assert reference.sd_mm == pytest.approx(0.02, rel=0.05)
