"""Plates: a plane is taken off whatever its tilt, and what is no plate is refused."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.plates import plate_residual
from files.errors import RecipeError
from sensors.recording import Recording
from tests.support.small_parts import SPECKLE, datasheet, part, record

SHEET = datasheet(100)


def scanned(name: str = "plate", **placing: object) -> Recording:
    return record(part(name), SHEET, [], name=name, seed=3, profiles=60, pitch_mm=0.7, **placing)


@pytest.mark.parametrize("tilt_deg", [(0.0, 0.0), (9.0, -4.0)])
def test_a_plane_is_taken_off_and_the_noise_stays(tilt_deg: tuple[float, float]) -> None:
    quiet = record(
        part("plate"), SHEET, [], name="plate", seed=3, profiles=60, pitch_mm=0.7, speckle=None,
        tilt_deg=tilt_deg,
    )  # fmt: skip
    noise_mm = np.random.default_rng(5).normal(0.0, 0.02, quiet.depth_mm.shape)
    found = plate_residual(replace(quiet, depth_mm=quiet.depth_mm + noise_mm), SHEET)
    known = np.isfinite(found.residual_mm)
    assert known.mean() > 0.99
    # the sensor adds 2 µm of its own
    assert np.corrcoef(found.residual_mm[known], noise_mm[known])[0, 1] > 0.99
    rows, columns = np.indices(noise_mm.shape)
    for ramp in (rows, columns):
        assert abs(np.polyfit(ramp[known], found.residual_mm[known], 1)[0]) < 1e-4


def test_pitches_and_losses_are_measured() -> None:
    made = scanned()
    depth = made.depth_mm.copy()
    depth[5:15, 20:40] = np.nan
    found = plate_residual(replace(made, depth_mm=depth), SHEET)
    assert found.missing_share == pytest.approx(200 / depth.size)
    assert found.pitch_mm == pytest.approx((44.0 / 100, 0.7), rel=0.02)


def test_readings_off_the_plate_are_no_noise() -> None:
    made = scanned()
    depth = made.depth_mm.copy()
    depth[25:35, 45:55] += 5.0  # through a hole in the plate
    found = plate_residual(replace(made, depth_mm=depth), SHEET)
    assert not np.isfinite(found.residual_mm[25:35, 45:55]).any()
    assert np.isfinite(found.residual_mm).sum() == np.isfinite(depth).sum() - 100
    assert np.nanstd(found.residual_mm) < SPECKLE.amplitude_mm


def test_what_is_no_plate_is_refused() -> None:
    with pytest.raises(RecipeError, match="bowl: a reference should be a flat plate, got .* off"):
        plate_residual(scanned("bowl"), SHEET)
    made = scanned()
    few = np.full_like(made.depth_mm, np.nan)
    few[0, :50] = made.depth_mm[0, :50]
    with pytest.raises(RecipeError, match="plate: a reference plate needs readings"):
        plate_residual(replace(made, depth_mm=few), SHEET)


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 200.0])
def test_a_plate_is_seen_where_it_lay(heading_deg: float) -> None:
    made = scanned(tilt_deg=(9.0, -4.0), heading_deg=heading_deg)
    found = plate_residual(made, SHEET)
    assert np.isfinite(found.view.depth_mm).all()
    assert (found.view.cos_incidence > 0.9).all()
    off = found.view.depth_mm - (made.depth_mm - found.residual_mm)
    assert np.nanmax(np.abs(off)) < 1e-6
