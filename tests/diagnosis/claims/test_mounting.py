"""A mounting error is what recordings in several orientations share, where their faces tell it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagnosis.claims.mounting import (
    Misplaced,
    Mounting,
    blurs,
    mounted,
    mounting_error,
    travelled_mm,
)
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


def weighed(poses: list[Field], lay: list[Placement]) -> Mounting:
    return mounting_error([Misplaced.of(p, q) for p, q in zip(poses, lay, strict=True)])


def test_a_shared_offset_is_the_mounting_s() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    found = weighed(poses, [placed(p, np.array([0.1, 0.0, -0.2]), KNOWN) for p in poses])
    assert found.nats > np.log(20)
    assert np.allclose(found.error[[3, 4]], [0.1, 0.0], atol=5e-3)
    low, high = found.interval(4)
    assert low < 0 < high


def test_a_height_may_be_the_part_s_or_the_mounting_s() -> None:
    # however a part is turned about its normal: it may lie too low, or its CAD's zero may
    poses = [commanded(t) for t in TURNS_DEG]
    found = weighed(poses, [placed(p, np.array([0.0, 0.0, -0.2]), KNOWN) for p in poses])
    assert found.nats < 1
    assert found.error[5] == 0


def test_parts_that_lay_elsewhere_each_time_are_none() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    shifts = np.random.default_rng(3).normal(0, 0.1, (40, 3, 3))
    nats = [
        weighed(poses, [placed(p, s, KNOWN) for p, s in zip(poses, each, strict=True)]).nats
        for each in shifts
    ]
    assert np.mean(nats) < 0
    # odds of 20 against, by chance in at most one of 20: a Bayes factor's own bound
    assert np.mean(np.array(nats) > np.log(20)) <= 0.05


def test_what_the_part_s_faces_leave_open_is_none() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    open_xy = KNOWN.copy()
    open_xy[:2] = 1.0  # a flat part lies anywhere along its face
    offset = np.array([0.3, 0.0, 0.0])
    assert weighed(poses, [placed(p, offset, KNOWN) for p in poses]).nats > 5
    assert weighed(poses, [placed(p, offset, open_xy) for p in poses]).nats < 1


def test_one_orientation_tells_nothing() -> None:
    poses = [commanded(0.0)] * 3
    found = weighed(poses, [placed(p, np.array([0.1, 0, 0]), KNOWN) for p in poses])
    assert abs(found.nats) < 2


def test_what_scatters_is_left_at_zero() -> None:
    poses = [commanded(t) for t in TURNS_DEG]
    shifts = [np.array([0.3, 0.0, z]) for z in (0.12, -0.03, 0.06)]
    found = weighed(poses, [placed(p, s, KNOWN) for p, s in zip(poses, shifts, strict=True)])
    assert found.error[5] == 0
    assert np.isclose(found.error[3], 0.3, atol=0.1)


def test_recordings_that_lie_as_told_bear_the_mounting_out() -> None:
    poses = [commanded(t) for t in (*TURNS_DEG, 45.0)]
    offset, scatter = np.array([0.3, 0.0, 0.0]), np.diag([0.02, 0.02, 0.02])
    fitted = [placed(p, offset + s, KNOWN) for p, s in zip(poses[:3], scatter, strict=True)]
    nats = weighed(poses[:3], fitted).nats
    assert weighed(poses, [*fitted, placed(poses[3], offset, KNOWN)]).nats > nats + 1
    assert weighed(poses, [*fitted, placed(poses[3], np.zeros(3), KNOWN)]).nats < nats
    # nor does one that says nothing
    open_all = np.array([2.0] * 3 + [0.02] * 3 + [1e-4] * 3)
    beside = weighed(poses, [*fitted, placed(poses[3], offset, open_all)]).nats
    assert abs(beside - nats) < 0.5


def test_intervals_hold_what_mountings_are_off() -> None:
    rng, held = np.random.default_rng(8), []
    for _ in range(60):
        poses = [commanded(t) for t in rng.uniform(0, 360, 4)]
        off = rng.normal(0, 0.2)
        lay = [placed(p, np.array([off, 0, 0]) + rng.normal(0, 0.05, 3), KNOWN) for p in poses]
        low, high = weighed(poses, lay).interval(3)
        held.append(low < off < high)
    assert np.mean(held) >= 0.85


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


def test_what_baselines_have_is_no_change_of_the_mounting() -> None:
    off, more = np.array([0.3, 0.0, 0.0]), np.array([0.5, 0.0, 0.0])
    poses = [commanded(t) for t in TURNS_DEG]
    good = [Misplaced.of(p, placed(p, off, KNOWN)) for p in poses]
    same = mounting_error([Misplaced.of(p, placed(p, off, KNOWN)) for p in poses], good)
    assert same.nats < 0
    changed = mounting_error([Misplaced.of(p, placed(p, more, KNOWN)) for p in poses], good)
    assert changed.nats > np.log(20)
    assert changed.error[3] == pytest.approx(0.2, abs=0.02)


def test_of_numbers_none_of_which_is_sure_by_itself_the_surest_is_given() -> None:
    """Together they may be: a mounting that is off has some number that isn't zero."""
    means = np.array([[0.0, 0.02, -0.08, 0.01, 0.0, 0.0]])
    found = Mounting(
        nats=4.0, weights=np.ones(1), means=means, covariances=np.diag(np.full(6, 0.05**2))[None]
    )
    assert all(low < 0 < high for low, high in map(found.interval, range(6)))
    assert found.error == pytest.approx([0, 0, -0.08, 0, 0, 0])
