"""The scan that an answer proposes: read, drawn, and laid over the part."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from challenge.measure import RANDOM, RANKED, answers, folder, measure
from challenge.scans import SHIFT_MM, SPEED, TILT_DEG, TURN_DEG, Change, drawn, first_proposed, of
from challenge.side_answers import further

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


@pytest.mark.parametrize("change", [Change(turn_deg=70.0), Change(tilt_deg=(5.0, -3.0))])
def test_turns_and_tilts_look_at_the_same_place(change):
    moved = change.moved(pose(), WAY, 12.0, 120.0)
    np.testing.assert_allclose(place(moved), place(pose()), atol=1e-9)
    np.testing.assert_allclose(moved[:3, :3] @ moved[:3, :3].T, np.eye(3), atol=1e-12)


def test_a_turned_part_is_seen_turned_about_its_z():
    moved = Change(turn_deg=90.0).moved(pose(), WAY, 12.0, 120.0)
    # the sensor's axis keeps its lean against the part's z, its line is turned by 90 degrees
    assert moved[2, 2] == pytest.approx(pose()[2, 2])
    before, after = pose()[:2, 0], moved[:2, 0]
    angle = np.degrees(np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0]))
    assert (angle + 90.0) % 360 == pytest.approx(0.0, abs=1e-9)


def test_a_shift_is_along_the_line_and_the_travel_and_a_standoff_along_the_axis():
    moved = Change(shift_mm=(2.0, -1.0), standoff_mm=3.0).moved(pose(), WAY, 12.0, 120.0)
    step = pose()[:3, :3].T @ (moved[:3, 3] - pose()[:3, 3])
    np.testing.assert_allclose(step, [2.0, -1.0, -3.0], atol=1e-9)
    np.testing.assert_allclose(moved[:3, :3], pose()[:3, :3], atol=1e-12)


def test_the_first_scan_that_can_be_taken_is_read():
    answer = {"next_measurements": [
        {"statement": "measure a certified step", "change": {}},
        {"statement": "turn the part", "change": {"turn_deg": 90, "speed": None},
         "expected_log_odds": 4.0},
        {"statement": "shift", "change": {"shift_mm": 3}},
    ]}  # fmt: skip
    assert first_proposed(answer) == Change(turn_deg=90.0)
    assert first_proposed({"next_measurements": [{"what": "shift", "shift_mm": 3}]}) == Change(
        shift_mm=(3.0, 0.0)
    )
    assert first_proposed({}) is None
    assert first_proposed(None) is None
    with pytest.raises(ValueError, match="one number or two"):
        of({"tilt_deg": [1, 2, 3]})


def test_random_scans_change_one_thing_within_bounds():
    seen = [drawn(np.random.default_rng(k)) for k in range(200)]
    for change in seen:
        changed = [change.turn_deg != 0, change.tilt_deg != (0, 0), change.shift_mm != (0, 0),
                   change.speed != 1]  # fmt: skip
        assert sum(changed) == 1
        assert TURN_DEG[0] <= abs(change.turn_deg) <= TURN_DEG[1] or change.turn_deg == 0
        assert SPEED[0] <= change.speed <= SPEED[1]
        for size, bounds in ((np.hypot(*change.tilt_deg), TILT_DEG),
                             (np.hypot(*change.shift_mm), SHIFT_MM)):  # fmt: skip
            assert size == 0 or bounds[0] - 1e-9 <= size <= bounds[1] + 1e-9
    assert len({bool(c.turn_deg) for c in seen}) == 2


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
    proposed = [{"change": {"turn_deg": 90.0, "speed": 2.0}}]
    (into / "diagnosis.json").write_text(json.dumps({"next_measurements": proposed}))
    assert measure(tmp_path) == 0
    with h5py.File(tmp_path / "cases" / "case-001" / "a.h5") as first:
        pose_a, time_a, start_a = first["pose"][0], first["time"][1], first.attrs["start_time_s"]
    with h5py.File(folder(tmp_path, RANKED) / "case-001" / "b.h5") as more:
        assert np.isfinite(more["depth"][:]).mean() > 0.5
        assert more["time"][1] == pytest.approx(time_a / 2)
        assert more.attrs["start_time_s"] > start_a
        turned = more["pose"][0][:3, :3] @ pose_a[:3, :3].T
    np.testing.assert_allclose(turned, Rotation.from_euler("z", -90, degrees=True).as_matrix(),
                               atol=1e-9)  # fmt: skip
    assert (folder(tmp_path, RANDOM) / "case-001" / "b.h5").exists()
    assert measure(tmp_path) == 0  # nothing left to do
