"""Sensor presets: each loads, names its source, and agrees with what its maker states."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from sensors.casting.laser import Laser
from sensors.datasheet import Datasheet, preset_names

FOLDER = Path(__file__).resolve().parents[2] / "sensors" / "presets"
FILES = sorted(FOLDER.glob("*.yaml"))
NULLABLE = {
    "repeatability_um",
    "triangulation_angle_deg",
    "line_width_um",
    "wavelength_nm",
    "exposure_s",
    "camera_rows",
}

# Near end of the range, far end, field of view at both: as the makers' sheets give them, mm.
RANGES = {
    "KEYENCE-LJ-X8080": (73 - 20.5, 73 + 20.5, 30, 39),
    "KEYENCE-LJ-X8200": (245 - 34, 245 + 34, 64, 80),
    "KEYENCE-LJ-X8900": (580, 1380, 300, 720),
    "LMI-Gocator-2350": (300, 700, 158, 365),
    "LMI-Gocator-2490": (350, 350 + 1525, 390, 2000),
    "LMI-Gocator-2880": (350, 1150, 390, 1260),
}


def test_the_paper_s_sensor_and_at_least_five_others_are_there() -> None:
    assert preset_names("presets") == [path.stem for path in FILES]
    assert "AT-C5-4090CS30-495" in preset_names("presets")
    assert len(FILES) >= 6
    assert len({path.stem.split("-")[0] for path in FILES}) >= 3, "makers"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
class TestEachPreset:
    def test_it_loads_by_its_name_which_is_its_file_s(self, path: Path) -> None:
        sheet = Datasheet.load(path.stem)
        assert sheet.name == path.stem
        assert Datasheet.load(path) == sheet

    def test_it_says_where_its_numbers_come_from(self, path: Path) -> None:
        comment = [line for line in path.read_text().splitlines() if line.startswith("#")]
        text = " ".join(line.lstrip("# ") for line in comment)
        source = r"Source: .*(data ?sheet|manual|Sensors 2023, 23, 7624)"
        assert re.search(source, text), "wanted: # Source: datasheet or manual, its page"

    def test_what_its_maker_does_not_state_is_null_and_every_key_is_there(self, path: Path) -> None:
        data = yaml.safe_load(path.read_text())
        fields = set(Datasheet.__dataclass_fields__)
        of_the_setup = {"travel_speed_mm_s", "camera_side", "optical_axis_x_mm"}
        left_out = fields - set(data) - of_the_setup
        assert not left_out, "each is stated, null where the maker doesn't state it"
        unknown = {key for key, value in data.items() if value is None} - NULLABLE
        assert not unknown, "a scan needs these: none may be null"
        assert data["effects"] == [], "a preset states the nominal model; no maker states effects"

    def test_the_range_lies_in_front_of_the_sensor(self, path: Path) -> None:
        sheet = Datasheet.load(path.stem)
        assert 0 < sheet.depth_min_mm < sheet.working_distance_mm < sheet.depth_max_mm
        assert sheet.step_mm < sheet.z_range_mm / 1000

    def test_its_line_has_the_stated_length_at_the_working_distance(self, path: Path) -> None:
        sheet = Datasheet.load(path.stem)
        laser = Laser.from_datasheet(sheet)
        points = laser.points_mm(np.full(sheet.points_per_profile, sheet.working_distance_mm))
        assert np.ptp(points[:, 0]) == pytest.approx(sheet.x_fov_mm, rel=1e-12)


def test_the_paper_s_sensor_has_the_values_of_table_1() -> None:
    sheet = Datasheet.load("AT-C5-4090CS30-495")
    assert (sheet.working_distance_mm, sheet.z_range_mm) == (400, 250)
    assert (sheet.points_per_profile, sheet.z_resolution_um) == (4096, 3.8)
    assert (sheet.profile_rate_hz, sheet.travel_speed_mm_s) == (500, 100)
    assert math.degrees(sheet.fov_rad) == pytest.approx(63.5, abs=0.05)


@pytest.mark.parametrize(("name", "ends"), RANGES.items())
def test_derived_figures_follow_from_the_stated_ends(
    name: str, ends: tuple[float, float, float, float]
) -> None:
    near, far, fov_near, fov_far = ends
    sheet = Datasheet.load(name)
    assert (sheet.depth_min_mm, sheet.depth_max_mm) == pytest.approx((near, far))
    assert fov_near < sheet.x_fov_mm < fov_far
    assert sheet.x_fov_mm == pytest.approx((fov_near + fov_far) / 2, rel=0.02)


@pytest.mark.parametrize("name", [name for name in RANGES if name.startswith("LMI")])
def test_a_fan_from_the_emitter_explains_both_stated_fields_of_view(name: str) -> None:
    near, far, fov_near, fov_far = RANGES[name]
    sheet = Datasheet.load(name)
    slope = 2 * math.tan(sheet.fov_rad / 2)
    assert slope * near == pytest.approx(fov_near, rel=0.06)
    assert slope * far == pytest.approx(fov_far, rel=0.06)


def test_presets_are_packaged() -> None:
    text = (FOLDER.parents[1] / "pyproject.toml").read_text()
    assert "presets/*.yaml" in text
