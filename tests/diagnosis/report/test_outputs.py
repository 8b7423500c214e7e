"""The files of a diagnosis: their form, and what another command makes of them."""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh

from diagnosis.diagnosis import Diagnosis
from flawforge.cli import main
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.recording import Recording
from sensors.view.view import View
from tests.support.small_parts import SPECKLE, datasheet, part, record

BOW = [{"name": "line_bow", "sag_um": 40.0}]


def test_diagnosis_json(diagnosed: tuple[Diagnosis, Path]) -> None:
    content = json.loads((diagnosed[1] / "diagnosis.json").read_text())
    assert content["format"] == "profilometer-diagnosis"
    assert content["version"] == 1
    assert content["verdict"] == "explained"
    effect = content["effects"][0]
    assert effect["name"] == "line_bow"
    assert set(effect) >= {
        "name", "statement", "parameters", "heldout_gain", "covariate", "frame", "alternatives",
    }  # fmt: skip
    assert effect["parameters"]["sag_um"]["low"] < 40 < effect["parameters"]["sag_um"]["high"]
    assert effect["heldout_gain"] > 0
    assert 0 < content["mismatch"]["share_of_points"] < 1
    region = content["mismatch"]["regions"][0]
    assert region["recording"] in ("left", "right", "kept back")
    assert region["effect"] == "line_bow"
    assert content["heldout"]["after"]["log_score"] < content["heldout"]["before"]["log_score"]
    assert content["recordings"] == {
        "fitted": ["left", "right"], "held_out": ["kept back"], "baselines": [],
    }  # fmt: skip
    assert effect["probability"] > 0.9
    assert effect["probability"] + effect["none_of_these"] <= 1.0 + 1e-9
    assert content["none_of_these"] < 0.1
    assert "calibration" in content["calibration_population"]
    assert content["settings"]["prior_cause"] > 0


def test_mismatch_maps_hold_every_recording(diagnosed: tuple[Diagnosis, Path]) -> None:
    with h5py.File(diagnosed[1] / "mismatch.h5") as file:
        assert set(file) == {"left", "right", "kept back"}
        group = file["kept back"]
        assert {k: (v.shape, v.dtype.kind) for k, v in group.items()} == {
            "mask": ((60, 100), "b"), "score": ((60, 100), "f"), "simulated": ((60, 100), "f"),
            "explained": ((60, 100), "f"),
        }  # fmt: skip
        ends = np.abs(group["explained"][:, :3] - group["simulated"][:, :3])
        assert np.nanmedian(ends) > 0.01


def test_the_sensor_found_reproduces_the_recordings(diagnosed: tuple[Diagnosis, Path]) -> None:
    """sensor.yaml simulates the bow, and its law leaves nothing of it."""
    sheet = Datasheet.load(diagnosed[1] / "sensor.yaml")
    assert [e["name"] for e in sheet.effects] == ["line_bow"]
    scene = part("bowl")
    plain = datasheet(100)
    again = record(scene, sheet, [], name="again", seed=9, profiles=60, pitch_mm=0.7, misplaced=0.0)
    truth = record(
        scene, plain, BOW, name="truth", seed=9, profiles=60, pitch_mm=0.7, misplaced=0.0
    )
    difference = again.depth_mm - truth.depth_mm
    assert np.nanmax(np.abs(difference)) < 0.1 * 0.040
    view = View(
        scene, SensorModel(sheet), again.poses, again.time_s, laser=Laser.from_datasheet(sheet)
    )
    residual = again.depth_mm - view.sensor.law(view, None).mean_mm
    columns = np.nanmean(residual, axis=0)
    assert np.abs(columns[:5].mean() - columns[48:52].mean()) < 0.004
    assert SPECKLE.amplitude_mm > 0


RECIPE = """\
name: bowls
seed: 5
sensor: sensor.yaml
surface: finish/surface.yaml
profiles: 60
scans: 1
parts: [{path: bowl.stl}]
flaws: {}
motion: {look: [0, 0, -1], travel: [0, 1, 0], length_mm: 41}
"""


@pytest.mark.slow
def test_a_recipe_with_the_sensor_found_makes_the_recordings_residuals(
    diagnosed: tuple[Diagnosis, Path], tmp_path: Path
) -> None:
    """Command by command: the bow and the noise of what was generated are the instrument's."""
    scene, sheet = part("bowl"), datasheet(100)
    sheet.save(tmp_path / "plain.yaml")
    shutil.copy(diagnosed[1] / "sensor.yaml", tmp_path)
    trimesh.Trimesh(scene.vertices_mm, scene.faces, process=False).export(tmp_path / "bowl.stl")
    plate = record(part("plate"), sheet, [], name="plate", seed=3, profiles=80, pitch_mm=0.7)
    plate.save(tmp_path / "plate.h5")
    (tmp_path / "bowls.yaml").write_text(RECIPE)
    at = {k: str(tmp_path / k) for k in ("plate.h5", "plain.yaml", "finish", "bowls.yaml", "data")}
    finish = ["--sensor", at["plain.yaml"], "--out", at["finish"]]
    assert main(["roughness", at["plate.h5"], *finish]) == 0
    assert main(["generate", at["bowls.yaml"], "--out", at["data"]]) == 0
    assert main(["export", at["data"], "--to", "recording"]) == 0
    truth = record(scene, sheet, BOW, name="t", seed=8, profiles=60, pitch_mm=0.7, misplaced=0.0)
    (file,) = (tmp_path / "data").glob("export*/*.h5")
    bow, noise = _residual_law(scene, sheet, truth)
    again, scatter = _residual_law(scene, sheet, Recording.load(file))
    both = np.isfinite(again) & np.isfinite(bow)
    assert both.sum() > 80
    # the mean over 60 profiles of noise that is correlated over two or three
    assert np.std((again - bow)[both]) < 0.004 < 0.5 * np.std(bow[both])
    assert scatter == pytest.approx(noise, rel=0.15)


def _residual_law(
    scene: Scene, sheet: Datasheet, made: Recording
) -> tuple[np.ndarray, float]:
    """Mean departure of each column from the part, mm (NaN: hardly read), the scatter about it."""
    left = made.depth_mm - scene.cast(Laser.from_datasheet(sheet), made.poses).depth_mm
    read = np.isfinite(left).sum(axis=0) > 40
    columns = np.full(left.shape[1], np.nan)
    columns[read] = np.nanmean(left[:, read], axis=0)
    return columns, float(np.nanstd(left - columns))
