"""Signal-to-noise ratio of a matched filter: closed form for white noise, draws for speckle."""

import dataclasses
import math

import numpy as np
import pytest

from pipeline.motion.trajectory import frame
from pipeline.scan.detectability import MatchedFilter, evidence_of
from pipeline.seeds import streams
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.effects.onboard_filter import OnboardFilter
from sensors.model import SensorModel
from sensors.surface.surface import Surface
from sensors.view.view import View
from tests.support.flawed_scan import SHEET, plate, scanned

N, M = 60, 160
BOX = (slice(20, 40), slice(60, 100))


@pytest.fixture(scope="module")
def view():
    part = plate()
    poses = np.tile(np.eye(4), (N, 1, 1))
    poses[:, :3, :3] = frame((0, 0, -1), (0, 1, 0))
    poses[:, 1, 3] = np.linspace(-7, 7, N)
    poses[:, 2, 3] = 100 + part.vertices_mm[:, 2].max()
    scene = Scene(part.vertices_mm, part.faces)
    laser = Laser.from_datasheet(SHEET)
    return View(scene, SensorModel(SHEET), poses, np.arange(N) / 500, laser=laser)


def dimple(depth_mm):
    y, x = np.mgrid[-1:1:20j, -1:1:40j]
    return depth_mm * np.maximum(1 - x**2 - y**2, 0)


def test_white_noise_has_the_textbooks_ratio(view):
    law = view.sensor.law(view, None)
    law = dataclasses.replace(law, white_sd_mm=0.05, step_mm=0.0)
    deviation = dimple(0.1)
    snr, response = MatchedFilter(law, view, view.depth_mm, view.depth_mm).weigh(BOX, deviation, 0)
    assert snr == pytest.approx(np.sqrt((deviation**2).sum()) / 0.05)
    assert response == pytest.approx(0)


@pytest.mark.parametrize("surface", ["car_door", "steel_plate"])
@pytest.mark.parametrize("depth_mm", [0.0, 0.05])
def test_the_response_is_normal_about_the_ratio(view, surface, depth_mm):
    field = Surface.load(surface).ready(0.25, 0.24, z_resolution_um=1.0, repeatability_um=2.0)
    law = view.sensor.law(view, field)
    template, real = dimple(0.05), dimple(depth_mm)
    found = []
    for number in range(300):
        reading, _ = law.sample(streams(number, "draw"), view)
        reading[BOX] += real
        matched = MatchedFilter(law, view, reading, view.depth_mm)
        snr, response = matched.weigh(BOX, template, 0)
        found.append(response - (snr if depth_mm else 0.0))
    assert abs(np.mean(found)) < 4 / math.sqrt(300)
    assert np.std(found) == pytest.approx(1, abs=0.17)  # 4 of its own deviations, 1 / √600


@pytest.mark.parametrize("gone", [0, 3, 300])
def test_lost_returns_move_the_response_and_leave_its_noise(view, gone):
    """A root of squares shrank the noise of pits to two thirds: 96 flaws had 0.82 in place of 1."""
    field = Surface.load("steel_plate").ready(0.25, 0.24, z_resolution_um=1.0, repeatability_um=2.0)
    law = view.sensor.law(view, field)
    template, found = dimple(0.05), []
    for number in range(300):
        reading, _ = law.sample(streams(number, "draw"), view)
        reading[BOX] += template
        matched = MatchedFilter(law, view, reading, view.depth_mm)
        snr, response = matched.weigh(BOX, template, gone)
        found.append(response - snr)
    assert abs(np.mean(found)) < 4 / math.sqrt(300)
    assert np.std(found) == pytest.approx(1, abs=0.17)


@pytest.mark.parametrize("surface", [None, "steel_plate"])
def test_filtered_noise_counts_with_its_correlation(view, surface):
    """What firmware smooths is quieter, reading by reading, and no easier to see through."""
    field = None
    if surface is not None:
        sheet = view.datasheet
        field = Surface.load(surface).ready(
            0.25, 0.24, z_resolution_um=sheet.z_resolution_um, repeatability_um=2.0
        )
    plain = view.sensor.law(view, field)
    effect = OnboardFilter(median_points=1, median_profiles=1, mean_points=5, mean_profiles=3)
    law = effect.apply(plain, view)
    template = dimple(0.05)
    found = []
    for number in range(300):
        reading, _ = law.sample(streams(number, "draw"), view)
        matched = MatchedFilter(law, view, reading, law.mean_mm)
        snr, response = matched.weigh(BOX, template, 0)
        found.append(response)
    assert np.std(found) == pytest.approx(1, abs=0.17)
    before, _ = MatchedFilter(plain, view, view.depth_mm, view.depth_mm).weigh(BOX, template, 0)
    assert snr == pytest.approx(before, rel=0.25)


def test_a_dent_below_the_noise_of_each_pixel_is_detected_over_its_footprint():
    surface = Surface.load("steel_plate")
    _, scan = scanned(plate(), "dent", surface=surface, length_mm=16.0, depth_mm=0.2)
    off = scan.depth_ideal_mm - scan.depth_clean_mm
    evidence = scan.evidence[1]
    assert np.nanmax(np.abs(off)) < 3 * scan.noise_mm.max()
    assert evidence.snr > 5
    assert evidence.deviation_max_mm == pytest.approx(np.nanmax(np.abs(off[scan.instance == 1])))
    rows, columns = np.nonzero(scan.instance == 1)
    assert evidence.rows == (rows.min(), rows.max() + 1)
    assert evidence.columns == (columns.min(), columns.max() + 1)


def test_lost_returns_count_by_how_rare_they_are(view):
    law = view.sensor.law(view, None)
    instance = np.zeros(view.shape, np.uint16)
    instance[30, 80:83] = 1
    gone = instance > 0
    clean, reading = view.depth_mm, np.where(gone, np.nan, view.depth_mm)
    flawed = dataclasses.replace(law, mean_mm=reading)
    depths = reading, clean, clean
    (_, one) = evidence_of(1, instance, gone, flawed, view, *depths)
    seen = np.count_nonzero(law.reason == 0)
    expected = math.sqrt(2 * 3 * math.log((seen + 2) / (3 + 1)))
    assert one.snr == pytest.approx(expected)
    assert evidence_of(2, instance, gone, flawed, view, *depths)[2] is None
