"""What a diagnosis is given: profiles that repeat are told and counted."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.inputs import check_fits, check_marks
from files.errors import RecipeError
from sensors.surface.surface import Surface
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import datasheet, part, record


def test_faults_of_the_inputs_are_told_before_the_first_registration() -> None:
    scene, sheet = part("domes"), datasheet(60)
    made = [
        record(scene, sheet, [], name=f"r{k}", seed=k, profiles=40, pitch_mm=0.7) for k in range(2)
    ]
    far = made[1].poses.copy()
    far[:, 0, 3] += 500.0
    needs_rows = dataclasses.replace(
        sheet, effects=({"name": "pixel_locking", "amplitude_px": 0.1},), camera_rows=None
    )
    sharp = Surface(name="sharp", rpm_mm=0.01, rvm_mm=0.01, pc_per_mm=500.0)
    bent = record(part("domes"), sheet, [], name="plate", seed=3, profiles=40, pitch_mm=0.7)
    steps: list[str] = []
    for recordings, sensor, more, fault in (
        ([made[0], replace(made[1], poses=far)], sheet, {}, "r1: doesn't overlap the part"),
        (made, needs_rows, {}, "camera_rows"),
        (made, sheet, {"surface": sharp}, "sharp"),
        (made, sheet, {"references": [bent]}, "plate: a reference should be a flat plate"),
    ):
        with pytest.raises(RecipeError, match=fault):
            diagnosis_of(recordings, scene, sensor, progress=steps.append, **more)
        assert steps == []


@pytest.mark.parametrize("mark", [-32768.0, 0.0, 65535.0, -99.9999])
@pytest.mark.parametrize("role", ["recording", "reference"])
def test_marks_for_missing_points_are_told_before_the_first_registration(
    mark: float, role: str
) -> None:
    scene, sheet = part("domes"), datasheet(60)
    made = [
        record(scene, sheet, [], name=f"r{k}", seed=k, profiles=40, pitch_mm=0.7) for k in range(2)
    ]
    depth = made[1].depth_mm.copy()
    depth[10:15, 20:30] = mark
    marked = replace(made[1], depth_mm=depth, name="marked")
    recordings, references = ([made[0], marked], []) if role == "recording" else (made, [marked])
    steps: list[str] = []
    with pytest.raises(RecipeError, match=r"marked: .*depth \S+ mm 50 times.*--missing") as fault:
        diagnosis_of(
            recordings, scene, sheet, references=references, progress=steps.append
        )
    assert steps == []
    assert f"depth {mark:.9g} mm" in str(fault.value)


def test_a_plane_seen_without_noise_and_stray_readings_are_no_marks() -> None:
    sheet = datasheet(60)
    made = record(part("domes"), sheet, [], name="r", seed=4, profiles=40, pitch_mm=0.7)
    check_marks(sheet, made)
    depth = made.depth_mm.copy()
    depth[:, :30] = sheet.depth_max_mm  # a floor far below, to the bit
    check_marks(sheet, replace(made, depth_mm=depth))
    depth[0, :3] = sheet.depth_max_mm + np.array([1.0, 2.0, 3.0])
    check_marks(sheet, replace(made, depth_mm=depth))


def test_columns_that_a_recording_places_are_not_spread_over_the_field_of_view() -> None:
    sheet = dataclasses.replace(datasheet(60), columns="even_x")
    made = record(part("domes"), sheet, [], name="r", seed=0, profiles=40, pitch_mm=0.7)
    window = replace(made, depth_mm=made.depth_mm[:, 10:50], x_mm=None)
    for x_mm, count in ((None, 1), (np.linspace(-10.0, 10.0, 40), 0)):
        notes: list[str] = []
        check_fits(sheet, replace(window, x_mm=x_mm), notes)
        assert len(notes) == count
