"""A story's picture: every panel shows something, and what it shows is what its title states."""

import json
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from matplotlib.figure import Figure

from challenge.judging.judge import judge
from challenge.proof.move_panel import PLANES, angles_deg, plane_of, stretch, stretched, title_of
from challenge.proof.page import Judged, write_page
from challenge.proof.panel import robust_sd
from challenge.proof.statistic_panel import CHANNELS, statistic, subject
from challenge.proof.story import RIGID, Move, Scanned, tell
from challenge.proof.story_picture import draw_story, panels_of

NAME = "case-001"


@pytest.fixture
def scored(judged):
    return judge(judged)["cases"][NAME]


def turned(staged, **motion):
    """Return the case's world with another motion of the sensor."""
    device = staged.on.device
    moved = replace(device, motion=replace(device.motion, **motion))
    return replace(staged, on=replace(staged.on, device=moved))


def titles(story):
    for panel in panels_of(story):
        axis = Figure().subplots()
        panel.draw(axis)
        drawn = [image.get_array() for image in axis.images]
        assert axis.lines or axis.patches or any(np.isfinite(a).any() for a in drawn), panel.title
    return [panel.title for panel in panels_of(story)]


def test_a_found_fault_has_six_panels(judged, bowed, scored, tmp_path):
    story = tell(judged, NAME, scored, bowed[1])
    assert [t.split(":")[0] for t in titles(story)] == [
        "the scan", "hidden", "found", "before", "after", "the paper's checks",
    ]  # fmt: skip
    # made again without the bow, the recording has the same speckle: they differ by the bow alone
    change = 1e3 * (story.held.depth_mm - story.without_mm)
    smooth = change - np.nanmedian(change, axis=0)
    assert np.nanmedian(np.abs(smooth)) < 0.2 * np.nanmedian(np.abs(change))
    draw_story(story, tmp_path / "story.png")
    assert (tmp_path / "story.png").exists()


def test_an_answer_that_moves_no_reading_shows_its_statistic(judged, bowed, scored):
    story = tell(judged, NAME, scored, bowed[1])
    still = replace(story.held, explained_mm=story.held.simulated_mm)
    left = [{"channel": "outliers", "covariate": "column of the profile", "probability": 0.7},
            {"channel": "mean", "covariate": "somewhere", "probability": 0.2}]  # fmt: skip
    alarm = replace(
        story, scans=(still, still), without_mm=None,
        answer={"verdict": "unexplained", "effects": [], "left": left},
    )  # fmt: skip
    assert titles(alarm)[1:3] == ["scan minus nominal model, µm", f"found: {CHANNELS['outliers']}"]
    # readings weigh otherwise under another noise, and are placed a hundredth of it elsewhere
    moved = still.simulated_mm + 1e-2 * robust_sd(still.depth_mm - still.simulated_mm)
    hardly = replace(still, explained_mm=moved)
    assert titles(replace(alarm, scans=(hardly, hardly))) == titles(alarm)
    nowhere = replace(alarm, answer={**alarm.answer, "left": left[1:]})
    assert titles(nowhere)[2] == f"found: {CHANNELS['mean']}"  # a map
    missed = replace(story, scans=(still, still), answer={"verdict": "match", "effects": []})
    assert [t.split(":")[0] for t in titles(missed)] == [
        "the scan", "hidden", "scan minus nominal model, µm", "the paper's checks",
    ]  # fmt: skip


def test_a_move_is_drawn_and_compared_at_the_poses(judged, bowed, scored):
    given = {key: {"value": 0.0} for key in RIGID} | {"pitch_deg": {"value": 0.2}}
    case = {**scored, "effects": [{"name": "pose_error", "parameters": given}]}
    staged = turned(bowed[1], pitch_rad=radians(0.19), yaw_rad=radians(0.05))
    story = tell(judged, NAME, case, staged)
    assert angles_deg(story.move.true)["pitch"] == pytest.approx(0.19)
    assert angles_deg(story.move.found)["pitch"] == pytest.approx(0.2)
    assert plane_of(story.move) is PLANES["pitch"]
    assert titles(story)[2:5] == [
        "the sensor's move, drawn 60 times as large",
        "before: scan minus nominal model where the poses say, µm",
        "after: scan minus model with what was found, µm",
    ]


@pytest.mark.parametrize(("rotation", "axes"), [("pitch", "x"), ("roll", "y"), ("yaw", "z")])
def test_each_rotation_is_drawn_in_its_own_plane(rotation, axes):
    from scipy.spatial.transform import Rotation

    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler(axes, 0.3, degrees=True).as_matrix()
    pose[:3, 3] = 0.1, 0.0, -0.2
    flat = np.full((8, 9), 100.0)
    move = Move(true=pose, found=None, x_mm=np.arange(9.0), y_mm=np.arange(8.0), surface_mm=flat)
    assert plane_of(move).rotation == rotation
    assert stretch([pose]) == 40
    assert "40 times" in title_of(move)
    large = stretched(pose, 40)
    assert angles_deg(large)[rotation] == pytest.approx(12.0)
    np.testing.assert_allclose(large[:3, 3], [4.0, 0.0, -8.0])


def test_the_channel_of_an_effect_that_moves_no_reading():
    effect = {"covariate": "time since the first profile"}
    better = {"before": {"missing_brier": 0.05}, "after": {"missing_brier": 0.04}}
    assert subject({"effects": [effect], "heldout": better})[0] == "missing"
    assert subject({"effects": [effect], "heldout": {}})[0] == "scale"


def test_statistics_of_a_recording():
    rng = np.random.default_rng(3)
    flat = np.full((200, 200), 100.0)
    noisy = flat + 0.02 * rng.standard_normal(flat.shape)
    noisy[::10, 0] = np.nan
    noisy[0, 1:21] += 1.0
    made = Scanned(
        depth_mm=noisy, simulated_mm=flat, explained_mm=flat, posed_mm=flat, angle_deg=0 * flat,
        located=flat > 0,
    )  # fmt: skip
    assert np.nanmean(statistic(made, "scale")) == pytest.approx(20.0, rel=0.02)
    assert np.nansum(statistic(made, "outliers")) == pytest.approx(2000.0, abs=500)
    assert np.nansum(statistic(made, "missing")) == 2000.0
    assert abs(np.nanmean(statistic(made, "mean"))) < 0.5


@pytest.mark.slow  # a page with its pictures
def test_pictures_of_another_run_are_removed(judged, bowed, tmp_path, monkeypatch):
    monkeypatch.setattr("challenge.proof.page.stage", lambda secret: bowed[1])
    old = tmp_path / "page" / "pictures" / "proof-story-3.png"
    old.parent.mkdir(parents=True)
    old.write_bytes(b"of another run")
    page = tmp_path / "page" / "proof.md"
    scored = judge(judged)
    answer = judged / "answers" / NAME / "diagnosis.json"
    left = {"channel": "scale", "covariate": "nothing", "probability": 0.6}
    answer.write_text(json.dumps({**json.loads(answer.read_text()), "left": [left]}))
    write_page([Judged.of(scored, judged)], page, commit="abc")
    assert not old.exists()
    assert old.with_name("proof-story-1.png").exists()
    assert "> Unexplained: scale over nothing, probability 0.60." in page.read_text()
