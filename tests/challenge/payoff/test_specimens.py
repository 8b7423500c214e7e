"""Flaws as solids: as deep as they say, where they say; the same for all three renderers."""

from dataclasses import replace
from math import atan, radians

import h5py
import numpy as np
import pytest

from challenge.cases.files import datasheet, write_yaml
from challenge.cases.nominal import NoiseLaw
from challenge.cases.parts import plate, solid_of, waves
from challenge.instrument.calibration import CalibrationPlan
from challenge.instrument.camera import Camera
from challenge.instrument.frames import Faults
from challenge.instrument.instrument import Instrument, Path
from challenge.instrument.motion import Motion
from challenge.instrument.peaks import PeakFinder
from challenge.instrument.sheet import LaserSheet
from challenge.payoff.flaws import KINDS, RANGES, SIZES, cutter, draw_flaw, patch_of
from challenge.payoff.segmenter import FEATURES, features
from challenge.payoff.sights import UprightCamera, UprightLaser
from challenge.payoff.simulate import flawforge, read_depths, recipe, write_parts
from challenge.payoff.specimens import LABEL_MM, draw_path, make_specimen
from challenge.second.case import datasheet as second_datasheet
from challenge.second.case import draw_device, travel_over

DISTANCE = 150.0
CAMERA = Camera(
    working_distance_mm=DISTANCE, triangulation_rad=radians(30), side=1, columns=160,
    fov_rad=2 * atan(8 / DISTANCE), rows=128, row_pitch_mm=0.05,
)  # fmt: skip
LIKE = Path(
    start=np.eye(4), direction=1, profiles=110, pitch_mm=0.1, rate_hz=100.0, start_s=0.0
)


def upright(path):
    return UprightLaser(path=path, camera=CAMERA)


@pytest.fixture(scope="module")
def part():
    return solid_of(waves(np.random.default_rng(3)))


@pytest.fixture(scope="module")
def specimen(part):
    rng = np.random.default_rng(5)
    return make_specimen(part, upright(draw_path(rng, LIKE, DISTANCE, 0.5)), rng)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", SIZES)
def test_a_patch_is_as_deep_and_as_long_as_drawn(kind, size):
    flaw = draw_flaw(kind, size, np.random.default_rng(7))
    for value, (low, high) in zip(
        (flaw.length_mm, flaw.width_mm, flaw.depth_mm), RANGES[kind, size], strict=True
    ):
        assert low <= value <= high
    plane, depth = patch_of(flaw)
    assert depth.max() == pytest.approx(flaw.depth_mm)
    for edge in (depth[0], depth[-1], depth[:, 0], depth[:, -1]):
        assert (edge < 0).all()  # above the surface all around
    steps = np.linalg.norm(np.diff(flaw.track_mm, axis=0), axis=1)
    assert steps.sum() == pytest.approx(flaw.length_mm)


def test_a_dent_s_cutter_has_a_paraboloid_s_volume():
    flaw = draw_flaw("dent", "large", np.random.default_rng(2))
    plane, depth = patch_of(flaw)
    lid = np.full(depth.shape, -1.0)
    solid = cutter(np.concatenate([plane, depth[..., None]], -1),
                   np.concatenate([plane, lid[..., None]], -1))  # fmt: skip
    # below the surface: half of depth times the ellipse's area
    below = solid.trim_by_plane([0, 0, 1], 0.0).volume()
    area = np.pi * flaw.length_mm * flaw.width_mm / 4
    assert below == pytest.approx(area * flaw.depth_mm / 2, rel=0.03)


@pytest.mark.parametrize("direction", [-1, 1])
def test_the_label_is_where_the_surface_lies_deeper(direction):
    flat = plate(np.random.default_rng(0))
    rng = np.random.default_rng(11)
    path = replace(LIKE, direction=direction)
    start = np.diag([1.0, -1.0, -1.0, 1.0])
    start[:3, 3] = (0, direction * 5.5, DISTANCE)
    path = replace(path, start=start)
    made = make_specimen(flat, upright(path), rng)
    assert len(made.flaws) > 6
    deviation = made.sight.depth(made.solid) - made.sight.depth(flat)
    assert ((made.instance > 0) == (deviation > LABEL_MM)).all()
    for k, flaw in enumerate(made.flaws):
        deepest = deviation[made.instance == k + 1].max()
        # the middle of what is narrow may fall between two rays
        least = 0.9 if flaw.kind in ("dent", "pit") else 0.5
        assert least * flaw.depth_mm < deepest <= flaw.depth_mm * 1.001 + 1e-4
    assert np.nanmax(np.abs(deviation[made.instance == 0])) <= 1e-3


def test_flaws_of_all_kinds_find_room_on_a_bent_part(part, specimen):
    assert {flaw.kind for flaw in specimen.flaws} == set(KINDS)
    seen = np.unique(specimen.instance[specimen.instance > 0])
    assert len(seen) >= len(specimen.flaws) - 1
    assert len(specimen.solid.faces) > len(part.faces)


def test_a_specimen_is_its_seed_s(part, specimen):
    rng = np.random.default_rng(5)
    again = make_specimen(part, upright(draw_path(rng, LIKE, DISTANCE, 0.5)), rng)
    assert np.array_equal(again.instance, specimen.instance)
    assert np.array_equal(again.solid.vertices_mm, specimen.solid.vertices_mm)


def test_the_simulation_scans_the_same_solids_on_the_same_paths(tmp_path, specimen):
    """The recipe's noise-free depth is the challenge's own geometry, and it cuts no flaw."""
    made = recipe([specimen], seed=1, sensor="sensor.yaml", surface="surface.yaml", parts="parts",
                  columns=160, artwork=None)  # fmt: skip
    assert "flaws" not in made
    write_parts(tmp_path / "parts", [specimen])
    device = _device()
    write_yaml(tmp_path / "sensor.yaml", datasheet(device, specimen.sight.path, [], 0.0))
    del made["surface"]
    write_yaml(tmp_path / "recipe.yaml", made)
    flawforge(["generate", "recipe.yaml", "--out", "made"], tmp_path)
    (depth,) = read_depths(tmp_path / "made", 1)
    truth = specimen.sight.depth(specimen.solid)
    both = np.isfinite(depth) & np.isfinite(truth)
    assert both.mean() > 0.9
    # rounded to 1 µm, with a noise of that size; rays beside a wall may fall on either side of it
    assert np.quantile(np.abs(depth - truth)[both], 0.999) < 0.002
    with h5py.File(next((tmp_path / "made").glob("shard-*.h5"))) as shard:
        assert not shard["mask"][:].any()


@pytest.fixture(scope="module")
def inclined(part):
    """Return a specimen under an inclined sheet, its upright camera telecentric."""
    rng = np.random.default_rng(6)
    device = draw_device(rng, slow=False)
    travel = travel_over(rng, device, 33.0, 0.1, 200.0, 110, 0.0, np.array([0, 0, 0.25]), 5.0)
    return make_specimen(part, UprightCamera(travel=travel, device=device), rng)


def test_under_an_inclined_sheet_flaws_are_cut_along_the_camera_s_axis(part, inclined):
    sight = inclined.sight
    assert {flaw.kind for flaw in inclined.flaws} == set(KINDS)
    assert sight.frame[:3, 2] == pytest.approx(sight.start[:3, :3] @ -sight.device.to_camera)
    assert sight.run / 0.1 == pytest.approx(sight.frame[:3, 1])
    before, after = sight.depth(part), sight.depth(inclined.solid)
    deviation = after - before
    assert ((inclined.instance > 0) == (deviation > LABEL_MM)).all()
    # a sheet at an angle to the cut goes deeper along itself, and up a steep wall
    cosine = np.cos(sight.device.camera.theta_rad)
    for k, flaw in enumerate(inclined.flaws):
        if flaw.kind == "dent" and (inclined.instance == k + 1).any():
            deepest = deviation[inclined.instance == k + 1].max()
            assert 0.9 * flaw.depth_mm < deepest < 1.25 * flaw.depth_mm / cosine
    # where rays hit lies in the field in which flaws are cut
    places, (low, high) = sight.places(before), sight.ends_mm
    near = np.isfinite(before)
    assert (np.abs(places[near, 0]) < high[0] + 0.6).all()
    assert np.median(places[near, 1]) == pytest.approx((low[1] + high[1]) / 2, abs=1.0)


def test_the_simulation_scans_under_an_inclined_sheet_too(tmp_path, inclined):
    sight = inclined.sight
    columns = sight.device.camera.columns
    made = recipe([inclined], seed=1, sensor="sensor.yaml", surface="none", parts="parts",
                  columns=columns, artwork=None)  # fmt: skip
    del made["surface"]
    write_parts(tmp_path / "parts", [inclined])
    stated = second_datasheet(sight.device, sight.travel, NoiseLaw(exponent=0, lean=0, worst=0))
    write_yaml(tmp_path / "sensor.yaml", stated | {"effects": [], "repeatability_um": 0.0})
    write_yaml(tmp_path / "recipe.yaml", made)
    flawforge(["generate", "recipe.yaml", "--out", "made"], tmp_path)
    (depth,) = read_depths(tmp_path / "made", 1)
    truth = sight.depth(inclined.solid)
    both = np.isfinite(depth) & np.isfinite(truth)
    assert both.mean() > 0.9
    step = sight.device.firmware.step_mm
    assert np.quantile(np.abs(depth - truth)[both], 0.999) < 2 * step + 0.001


def _device():
    return Instrument(
        sheet=LaserSheet(waist_mm=0.05, waist_z_mm=DISTANCE, exposure_s=1e-5), camera=CAMERA,
        finder=PeakFinder(kind="gravity", threshold=0.01, fraction_bits=10), faults=Faults(),
        motion=Motion(), plan=CalibrationPlan(), z_range_mm=12.0, step_mm=1e-3,
    )  # fmt: skip


def test_features_know_neither_place_nor_tilt():
    rng = np.random.default_rng(1)
    depth = rng.normal(0, 0.02, (60, 70))
    depth[20:25, 30:35] += 0.2
    depth[40, 10:20] = np.nan
    rows, columns = np.indices(depth.shape)
    found = features(depth)
    assert found.shape == (60, 70, FEATURES)
    moved = features(depth + 150.0 + 0.003 * rows - 0.002 * columns)
    assert np.allclose(found, moved, atol=2e-6, equal_nan=True)


def test_nothing_but_gaps_is_no_error():
    assert np.isnan(features(np.full((20, 30), np.nan))).all()
