"""How little light gives a reading is found beside shadows where the file doesn't state it."""

from dataclasses import replace

import pytest

from diagnosis.diagnose import assumed
from diagnosis.physics.assumed_threshold import with_threshold
from diagnosis.prepare import Inputs, Prepared, prepared
from sensors.datasheet import Datasheet
from tests.support.small_parts import VIEWS, datasheet, part, record

SHADOW = {"name": "camera_occlusion", "line_sd_um": 250.0}


def sheet_with(**stated: object) -> Datasheet:
    return datasheet(100, [{**SHADOW, **stated}])


def recorded(threshold: float, given: Datasheet) -> Prepared:
    """Prepare recordings of steps by a finder with a threshold, by the file that is given."""
    scene, views = part("steps"), VIEWS
    made = [
        record(scene, sheet_with(weakest=threshold), [], name=f"r{k}", seed=80 + k, profiles=72,
               pitch_mm=0.6, **view)
        for k, view in enumerate(views)
    ]  # fmt: skip
    return prepared(
        Inputs(
            recordings=made, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=given
        ),
        [], lambda _: None,
    )  # fmt: skip


@pytest.mark.parametrize("threshold", [0.04, 0.1, 0.25])
def test_the_threshold_that_readings_beside_shadows_show_is_assumed(threshold: float) -> None:
    given = sheet_with()
    ready = recorded(threshold, given)
    complete = ready.recorded.datasheet
    assert complete.effects == ({**SHADOW, "weakest": threshold},)
    assert assumed(complete, given) == {"camera_occlusion.weakest": threshold}
    assert all(p.view.datasheet is complete for p in ready.patches)


def test_a_file_that_states_the_threshold_or_lists_no_such_shadow_stays_as_it_is() -> None:
    ready = recorded(0.04, sheet_with(weakest=0.3))
    for sheet in (
        sheet_with(weakest=0.3),
        datasheet(100),
        replace(datasheet(100), effects=({"name": "camera_occlusion"},)),
    ):
        assert with_threshold(sheet, ready.patches, ready.baseline) is sheet
    assert assumed(ready.recorded.datasheet, sheet_with(weakest=0.3)) == {}
