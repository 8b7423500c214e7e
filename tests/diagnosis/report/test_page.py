"""The report stands by itself, and a browser shows it."""

import dataclasses
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from diagnosis.diagnosis import Diagnosis
from diagnosis.localise.residual_structure import Residual
from diagnosis.report.outputs import write_outputs
from diagnosis.report.page import render
from diagnosis.report.profile_picture import shown_of
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import VIEWS, datasheet, part, record


def test_report_stands_by_itself(diagnosed: tuple[Diagnosis, Path]) -> None:
    page = (diagnosed[1] / "report.html").read_text()
    assert "http://" not in page
    assert "https://" not in page
    assert page.count("data:image/png;base64,") >= 3
    assert "line_bow" in page
    text = re.sub(r"<[^>]+>", "", page)
    asked = ["Found: line bow (", "Where", "Cause:", "Place:", "What else it could be:",
             "What to do:", "Before and after, on held-out readings"]  # fmt: skip
    at = [text.index(words) for words in asked]
    assert at == sorted(at)
    assert "depth error at the ends of the line at the working distance, µm" in text


def test_regions_are_listed_with_place_size_and_cause(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    page = render(result, part_name="bowl")
    largest = max(
        result.regions,
        key=lambda r: (r.profiles[1] - r.profiles[0]) * (r.points[1] - r.points[0]),
    )
    first, end = largest.profiles
    assert f"<td>{largest.recording}</td><td class=\"n\">{first} to {end - 1}</td>" in page
    assert f"{largest.size_um:.0f} µm</td><td>line bow</td>" in page


@pytest.mark.parametrize(
    ("share", "words"), [(0.0, "0 %"), (1e-4, "under 1 %"), (0.41, "41 %"), (0.9999, "over 99 %")]
)
def test_a_probability_is_never_certain(
    diagnosed: tuple[Diagnosis, Path], share: float, words: str
) -> None:
    bow = dataclasses.replace(diagnosed[0].effects[0], none_of_these=share)
    page = render(dataclasses.replace(diagnosed[0], effects=(bow,)), part_name="bowl")
    assert f"none of the catalogued effects ({words})" in page


def test_a_doubt_is_stated_once(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    doubt = "The formula may be another."
    bow = result.effects[0]
    doubted = dataclasses.replace(bow, doubt=doubt, statement=f"{bow.statement} {doubt}")
    page = render(dataclasses.replace(result, effects=(doubted,)), part_name="bowl")
    assert page.count(doubt) == 1
    assert f"<b>Doubt:</b> {doubt}" in page


def test_a_match_shows_no_effects(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    match = dataclasses.replace(
        result, verdict="match", effects=(), after=result.before, regions=(), share_of_points=0.0
    )
    page = render(match, part_name="bowl")
    assert "with the effects" not in page
    assert "Where" not in page
    assert page.count("data:image/png;base64,") == 1
    assert [words for _, _, words in shown_of(match)] == ["nominal model"]


def test_what_is_left_is_stated_as_a_factor_or_a_share(diagnosed: tuple[Diagnosis, Path]) -> None:
    left = [
        Residual(channel="missing", covariate="column of the profile", frame="sensor",
                 size=0.4, unit="1", detail="losses of columns, 23 nats"),
        Residual(channel="scale", covariate="time", frame="time", size=0.7, unit="1"),
    ]  # fmt: skip
    unexplained = dataclasses.replace(
        diagnosed[0], verdict="unexplained", effects=(), left=tuple(left)
    )
    page = render(unexplained, part_name="bowl")
    assert "4 % of the readings" in page
    assert "factor 2" in page
    assert "the instrument, its calibration and optics" in page
    assert "column of the profile (losses of columns, 23 nats)" in page


def test_a_match_says_what_is_nearest_to_a_fault(diagnosed: tuple[Diagnosis, Path]) -> None:
    usual = Residual(channel="mean", covariate="incidence", frame="part", size=1.5, unit="µm",
                     probability=0.31, detail="incidence_bias, 12 nats")  # fmt: skip
    match = dataclasses.replace(diagnosed[0], verdict="match", effects=(), usual=(usual,))
    page = render(match, part_name="bowl")
    assert "Nearest to a fault: mean of the readings by incidence, 1.5 µm (31 %)." in page
    assert "incidence (incidence_bias, 12 nats)" in page
    rare = dataclasses.replace(usual, probability=0.01)
    assert "Nearest" not in render(dataclasses.replace(match, usual=(rare,)), part_name="bowl")


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
