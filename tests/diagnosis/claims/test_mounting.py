"""A mounting error is what recordings in several orientations share, where their faces tell it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagnosis.claims.mounting import _scatter, _Seen, blurs, mounted, mounting_error, travelled_mm
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.prepare import Inputs, Prepared, prepared
from diagnosis.register.placement import PRIOR_SD, Placement
from sensors.effects.line_bow import LineBow
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.pose_error import PoseError
from tests.support.small_parts import VIEWS, datasheet, part, record

BLUR = MotionBlur(exposure_ms=2.0)
TURNS_DEG = (0.0, 90.0, 180.0)
KNOWN = np.array([2e-3] * 3 + [1e-5] * 3 + [1e-4] * 3)


def commanded(turn_deg: float) -> Field:
    poses = np.tile(np.eye(4), (20, 1, 1))
    turn = Rotation.from_euler("z", turn_deg, degrees=True) * Rotation.from_euler("x", np.pi)
    poses[:, :3, :3] = turn.as_matrix()
    poses[:, :3, 3] = [0.0, 0.0, 100.0]
    poses[:, :3, 3] += np.linspace(-5, 5, 20)[:, None] * poses[0, :3, 1]
    return poses


def placed(poses: Field, shift_mm: Field, sd: Field) -> Placement:
    """A placement by a shift in the sensor's frame, each of its numbers known to `sd`."""
    shift = np.zeros(PRIOR_SD.size)
    shift[:3] = poses[0, :3, :3] @ shift_mm
    return Placement(
        shift=shift, centre_mm=np.zeros(3), covariance=np.diag(sd**2), poses=poses
    )  # fmt: skip


def test_a_shared_offset_is_the_mounting_s() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    found = mounting_error(poses, [placed(p, np.array([0.1, 0.0, -0.2]), KNOWN) for p in poses])
    assert found is not None
    assert np.isclose(found.effect.x_mm, 0.1, atol=1e-3)
    assert np.isclose(found.effect.z_mm, -0.2, atol=1e-3)
    y = found.intervals["y_mm"]
    assert y.low is not None
    assert y.high is not None
    assert y.low < 0 < y.high


def test_parts_that_lay_elsewhere_each_time_are_none() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    shifts = np.random.default_rng(3).normal(0, 0.1, (3, 3))
    lay = [placed(p, s, KNOWN) for p, s in zip(poses, shifts, strict=True)]
    assert mounting_error(poses, lay) is None


def test_what_the_part_s_faces_leave_open_is_none() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    open_xy = KNOWN.copy()
    open_xy[:2] = 1.0  # a flat part lies anywhere along its face
    offset = np.array([0.3, 0.0, 0.0])
    assert mounting_error(poses, [placed(p, offset, KNOWN) for p in poses]) is not None
    assert mounting_error(poses, [placed(p, offset, open_xy) for p in poses]) is None


def test_one_orientation_tells_nothing() -> None:
    poses = [commanded(t) for t in (0.0, 5.0, 10.0)]
    assert mounting_error(poses, [placed(p, np.array([0.1, 0, 0]), KNOWN) for p in poses]) is None


def test_what_scatters_is_left_at_zero() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    shifts = [np.array([0.3, 0.0, z]) for z in (0.12, -0.03, 0.06)]
    found = mounting_error(poses, [placed(p, s, KNOWN) for p, s in zip(poses, shifts, strict=True)])
    assert found is not None
    assert found.effect.z_mm == 0
    assert np.isclose(found.effect.x_mm, 0.3, atol=0.02)


def test_a_recording_that_lies_as_told_bears_the_mounting_out() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    offset, scatter = np.array([0.3, 0.0, 0.0]), np.diag([0.02, 0.02, 0.02])
    fitted = [placed(p, offset + s, KNOWN) for p, s in zip(poses, scatter, strict=True)]
    found = mounting_error(poses, fitted)
    assert found is not None
    other = commanded(45.0)
    assert found.gain(other, placed(other, offset, KNOWN)) > 1
    assert found.gain(other, placed(other, np.zeros(3), KNOWN)) < 0
    # nor does one that says nothing
    open_all = np.array([2.0] * 3 + [0.02] * 3 + [1e-4] * 3)
    assert abs(found.gain(other, placed(other, offset, open_all))) < 0.5


def test_how_parts_lie_is_measured() -> None:
    rng, lies = np.random.default_rng(5), np.array([0.05, 4e-4])
    sure = np.diag((1e-3 * KNOWN) ** 2)
    seen = []
    for turn in rng.uniform(0, 360, 60):
        poses, shift = commanded(turn), np.zeros(PRIOR_SD.size)
        shift[:6] = rng.normal(0, np.repeat(lies, 3))
        placement = Placement(shift=shift, centre_mm=np.zeros(3), covariance=sure, poses=poses)
        seen.append(_Seen.of(poses, placement))
    # what registration scatters by itself, 0.01 degrees at 100 mm, is told apart
    assert np.allclose(_scatter(seen, shared=True) / lies, 1.0, atol=0.15)
    assert np.allclose(_scatter(seen, shared=False) / lies, 1.0, atol=0.15)




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
