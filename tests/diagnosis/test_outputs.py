"""The four files of a diagnosis: their form, and a report that a browser shows."""

import dataclasses
import json
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from benchmarks.relief import SPECKLE, VIEWS, datasheet, part, record
from diagnosis.diagnose import Diagnosis, diagnose
from diagnosis.outputs import write_outputs
from sensors.datasheet import Datasheet
from sensors.laser import Laser
from sensors.law import plain_law
from sensors.view import View

BOW = [{"name": "line_bow", "sag_um": 40.0}]


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Diagnosis, Path]:
    scene, sheet = part("bowl"), datasheet(100)
    made = [
        record(scene, sheet, BOW, name=n, seed=k, profiles=60, pitch_mm=0.7, **VIEWS[k])
        for k, n in enumerate(("left", "right", "kept back"))
    ]
    result = diagnose(made, scene.vertices_mm, scene.faces, sheet)
    folder = tmp_path_factory.mktemp("diagnosis")
    write_outputs(result, folder, part_name="bowl")
    return result, folder


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
    assert content["recordings"] == {"fitted": ["left", "right"], "held_out": ["kept back"]}


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
    view = View(scene, sheet, again.poses, again.time_s, laser=Laser.from_datasheet(sheet))
    residual = again.depth_mm - plain_law(view, None).mean_mm
    columns = np.nanmean(residual, axis=0)
    assert np.abs(columns[:5].mean() - columns[48:52].mean()) < 0.004
    assert SPECKLE.amplitude_mm > 0


def test_report_stands_by_itself(diagnosed: tuple[Diagnosis, Path]) -> None:
    page = (diagnosed[1] / "report.html").read_text()
    assert "http://" not in page
    assert "https://" not in page
    assert page.count("data:image/png;base64,") >= 3
    assert "line_bow" in page
    assert "Measure next" in page


def test_report_opens_in_a_browser(diagnosed: tuple[Diagnosis, Path], tmp_path: Path) -> None:
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium installed to open the report in")
    done = subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            f"--user-data-dir={tmp_path}", "--virtual-time-budget=2000", "--dump-dom",
            (diagnosed[1] / "report.html").as_uri(),
        ],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-500:]
    assert 'id="verdict"' in done.stdout
    assert "line bow" in done.stdout


def test_pixel_locking_is_found_and_drawn_where_no_rows_are_stated(tmp_path: Path) -> None:
    scene = part("domes")
    rows = [{"name": "pixel_locking", "amplitude_px": 0.3, "rows": 700.0}]
    made = [
        record(scene, datasheet(100), rows, name=f"r{k}", seed=k, profiles=60, pitch_mm=0.7,
               **VIEWS[k])
        for k in range(2)
    ]  # fmt: skip
    sheet = dataclasses.replace(datasheet(100), camera_rows=None)
    result = diagnose(made, scene.vertices_mm, scene.faces, sheet)
    assert [e.name for e in result.effects] == ["pixel_locking"]
    assert result.effects[0].parameters["rows"][0] == pytest.approx(700.0, rel=2e-3)
    write_outputs(result, tmp_path, part_name="domes")
    assert "fraction of the camera" in (tmp_path / "report.html").read_text()
