"""The scan that an answer proposes: read, drawn, and laid over the part."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from challenge.judging.side_answers import further
from challenge.runs.measure import RANDOM, RANKED, answers, folder, measure
from challenge.runs.scans import DRAWN, Change, drawn, first_proposed

WAY = np.array([0.0, 1.0, 0.0])


def pose():
    out = np.eye(4)
    out[:3, :3] = Rotation.from_euler("xyz", [180, 4, 20], degrees=True).as_matrix()
    out[:3, 3] = [2.0, -9.0, 120.0]
    return out


def place(start, span=12.0, distance=120.0):
    """Where the sensor looks in the middle of the scan."""
    return start[:3, 3] + start[:3, :3] @ (WAY * span / 2 + np.array([0, 0, distance]))


def test_no_change_is_the_first_scan():
    np.testing.assert_allclose(Change().moved(pose(), WAY, 12.0, 120.0), pose(), atol=1e-12)


@pytest.mark.parametrize("change", [Change(turn_deg=70.0), Change(tilt_deg=5.0)])
def test_turns_and_tilts_look_at_the_same_place(change):
    moved = change.moved(pose(), WAY, 12.0, 120.0)
    np.testing.assert_allclose(place(moved), place(pose()), atol=1e-9)
    np.testing.assert_allclose(moved[:3, :3] @ moved[:3, :3].T, np.eye(3), atol=1e-12)


def test_the_part_is_turned_about_the_sensor_s_axis_and_tilted_about_its_line():
    turned = Change(turn_deg=90.0).moved(pose(), WAY, 12.0, 120.0)
    np.testing.assert_allclose(turned[:3, 2], pose()[:3, 2], atol=1e-12)
    np.testing.assert_allclose(turned[:3, 0], pose()[:3, 1], atol=1e-12)
    tilted = Change(tilt_deg=8.0).moved(pose(), WAY, 12.0, 120.0)
    np.testing.assert_allclose(tilted[:3, 0], pose()[:3, 0], atol=1e-12)
    assert tilted[:3, 2] @ pose()[:3, 2] == pytest.approx(np.cos(np.radians(8.0)))


def test_a_shift_is_along_the_line_and_a_range_along_the_axis():
    moved = Change(shift_mm=2.0, range_mm=3.0).moved(pose(), WAY, 12.0, 120.0)
    step = pose()[:3, :3].T @ (moved[:3, 3] - pose()[:3, 3])
    np.testing.assert_allclose(step, [2.0, 0.0, -3.0], atol=1e-9)
    np.testing.assert_allclose(moved[:3, :3], pose()[:3, :3], atol=1e-12)


def test_the_first_scan_that_can_be_taken_is_read():
    plain = {"like": "a", "turn_deg": 0.0, "shift_mm": 0.0, "tilt_deg": 0.0, "range_mm": 0.0,
             "slower": 1.0, "between": ["line_bow", "form_error"]}  # fmt: skip
    answer = {"next_measurements": [
        {**plain, "what": "measure a certified step"},
        {**plain, "what": "turn the part", "turn_deg": 90.0, "expected_log_odds": 4.0},
        {**plain, "what": "shift", "shift_mm": 3.0},
    ]}  # fmt: skip
    assert first_proposed(answer) == Change(turn_deg=90.0)
    inside = {"next_measurements": [{"change": {"slower": 4, "turn_deg": None}}]}
    assert first_proposed(inside) == Change(slower=4.0)
    assert first_proposed({}) is None
    assert first_proposed(None) is None


def test_random_scans_change_one_thing_within_bounds():
    seen = [drawn(np.random.default_rng(k)).as_json() for k in range(200)]
    for change in seen:
        (key, value), = ((k, v) for k, v in change.items() if v != Change().as_json()[k])
        low, high = DRAWN[key]
        assert low <= abs(value) <= high
    assert {k for c in seen for k, v in c.items() if v != Change().as_json()[k]} == set(DRAWN)


SECRET = {"kind": "undecidable", "switches": ["bowed calibration plate"], "strength": 1,
          "shape": "waves", "recordings": 1, "seed": 5, "family": "second"}  # fmt: skip


def answered(out, way, effects):
    into = answers(out, way) / "case-001"
    into.mkdir(parents=True)
    (into / "run.json").write_text(json.dumps({"code": 0, "seconds": 1.0}))
    (into / "diagnosis.json").write_text(json.dumps({"verdict": "explained", "effects": effects}))


def test_a_further_scan_is_right_by_the_first_name_and_decides_without_the_rival(tmp_path):
    beside = [{"name": "form_error", "probability": 0.3}]
    answered(tmp_path, RANKED, [{"name": "line_bow", "heldout_gain": 1.0}])
    answered(tmp_path, RANDOM, [{"name": "line_bow", "heldout_gain": 1.0, "alternatives": beside}])
    assert further(tmp_path, RANKED, "case-001", SECRET) == {"right": True, "alone": True}
    assert further(tmp_path, RANDOM, "case-001", SECRET) == {"right": True, "alone": False}
    assert further(tmp_path, RANKED, "case-002", SECRET) is None
    assert further(tmp_path, RANKED, "case-001", {**SECRET, "kind": "one"}) is None


def test_measuring_needs_a_finished_set(tmp_path):
    with pytest.raises(ValueError, match="commitments"):
        measure(tmp_path)


@pytest.mark.slow
def test_the_sealed_instrument_takes_the_proposed_scan_of_the_same_part(tmp_path):
    import h5py

    from challenge.cases.case import Secret
    from challenge.second import case as second

    secret = Secret.of_key(SECRET)
    second.write(secret, second.stage(secret), tmp_path / "cases" / "case-001")
    second.withhold(secret, tmp_path / "cases" / "case-001")
    (tmp_path / "commitments.json").write_text("{}")
    (tmp_path / "keys").mkdir()
    (tmp_path / "keys" / "case-001.key.json").write_text(json.dumps({"secret": SECRET}))
    into = tmp_path / "answers" / "case-001"
    into.mkdir(parents=True)
    (into / "run.json").write_text("{}")
    proposed = [{"change": {"turn_deg": 90.0, "slower": 0.5}}]
    (into / "diagnosis.json").write_text(json.dumps({"next_measurements": proposed}))
    assert measure(tmp_path) == 0
    with h5py.File(tmp_path / "cases" / "case-001" / "a.h5") as first:
        pose_a, time_a, start_a = first["pose"][0], first["time"][1], first.attrs["start_time_s"]
    with h5py.File(folder(tmp_path, RANKED) / "case-001" / "b.h5") as more:
        assert np.isfinite(more["depth"][:]).mean() > 0.5
        assert more["time"][1] == pytest.approx(time_a / 2)
        assert more.attrs["start_time_s"] > start_a
        turned = pose_a[:3, :3].T @ more["pose"][0][:3, :3]
    np.testing.assert_allclose(turned, Rotation.from_euler("z", 90, degrees=True).as_matrix(),
                               atol=1e-9)  # fmt: skip
    assert (folder(tmp_path, RANDOM) / "case-001" / "b.h5").exists()
    assert measure(tmp_path) == 0  # nothing left to do
