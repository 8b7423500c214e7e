"""The report stands by itself, and a browser shows it."""

import dataclasses
import shutil
import subprocess
from pathlib import Path

import pytest

from diagnosis.diagnosis import Diagnosis
from diagnosis.report.outputs import write_outputs
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import VIEWS, datasheet, part, record


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


@pytest.mark.slow
def test_a_shadow_is_drawn_where_the_file_states_no_camera(tmp_path: Path) -> None:
    scene, hidden = part("steps"), [{"name": "camera_occlusion", "triangulation_angle_deg": 30.0}]
    made = [
        record(scene, datasheet(100), hidden, name=f"r{k}", seed=k, profiles=60, pitch_mm=0.7,
               **VIEWS[k])
        for k in range(3)
    ]  # fmt: skip
    sheet = dataclasses.replace(datasheet(100), triangulation_angle_deg=None)
    result = diagnosis_of(made, scene, sheet)
    assert result.effects[0].name == "camera_occlusion"
    write_outputs(result, tmp_path, part_name="steps")
    assert "camera_occlusion" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_pixel_locking_is_found_and_drawn_where_no_rows_are_stated(tmp_path: Path) -> None:
    scene = part("domes")
    rows = [{"name": "pixel_locking", "amplitude_px": 0.3, "rows": 700.0}]
    made = [
        record(scene, datasheet(100), rows, name=f"r{k}", seed=k, profiles=60, pitch_mm=0.7,
               **VIEWS[k])
        for k in range(2)
    ]  # fmt: skip
    sheet = dataclasses.replace(datasheet(100), camera_rows=None)
    result = diagnosis_of(made, scene, sheet)
    assert [e.name for e in result.effects] == ["pixel_locking"]
    assert result.effects[0].parameters["rows"].value == pytest.approx(700.0, rel=2e-3)
    write_outputs(result, tmp_path, part_name="domes")
    assert "fractional camera row" in (tmp_path / "report.html").read_text()
