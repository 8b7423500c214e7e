"""Against claims: a good mounting is no error, one that all recordings share is."""

import pytest

from diagnosis.claims.claims import blurs, mounted, travelled_mm
from diagnosis.model.workspace import Model, Workspace
from diagnosis.prepare import Inputs, Prepared, prepared
from sensors.effects.line_bow import LineBow
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.pose_error import PoseError
from tests.support.small_parts import VIEWS, datasheet, part, record

BLUR = MotionBlur(exposure_ms=2.0)


def ready(*effects: dict[str, object]) -> Prepared:
    scene, sheet = part("wedge"), datasheet(80)
    made = [
        record(scene, sheet, effects, name=f"r{k}", seed=k, profiles=60, pitch_mm=0.7, **view)
        for k, view in enumerate(VIEWS)
    ]
    given = Inputs(
        recordings=made, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=sheet
    )
    return prepared(given, [], lambda _: None)


def shared(one: Prepared) -> list[PoseError]:
    ws = Workspace.build([p for p in one.patches if p.fit.any()], one.noise)
    held = [p for p in one.patches if p.scored.any()]
    found = mounted(ws, Model(), one.recorded.recordings, one.placed, held)
    return [f.effect for f in found if isinstance(f.effect, PoseError)]


def test_parts_that_lie_off_by_chance_are_no_mounting_error() -> None:
    assert shared(ready()) == []


def test_a_roll_that_all_recordings_share_is_one() -> None:
    (found,) = shared(ready({"name": "pose_error", "roll_deg": 0.4}))
    assert found.roll_deg == pytest.approx(0.4, abs=0.1)


def test_a_pose_is_uncertain_by_half_the_way_of_an_exposure() -> None:
    one = ready()
    ws = Workspace.build(one.patches, one.noise)
    assert travelled_mm(ws, Model(effects=(LineBow(sag_um=1.0),))) == 0.0
    assert blurs(Model(effects=(BLUR,))) == [BLUR]
    # 0.7 mm of travel in 5 ms between profiles, over 2 ms
    assert travelled_mm(ws, Model(effects=(BLUR,))) == pytest.approx(0.5 * 0.7 * 2 / 5, rel=0.05)
