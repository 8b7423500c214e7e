"""Placement by a model's law: blurred edges tell a small part of a pitch."""

import numpy as np
import pytest

from diagnosis.data.patch import cut
from diagnosis.model.model import Model
from diagnosis.register.placement import PRIOR_SD, Placement, move
from diagnosis.reregister.edge_placement import placed_by_law
from sensors.casting.laser import Laser
from sensors.effects.motion_blur import MotionBlur
from tests.support.effect_case import bench_workspace
from tests.support.small_parts import VIEWS, datasheet, part, record

PITCH_MM = 0.4
SHADOWS = {"name": "camera_occlusion", "line_sd_um": 100.0, "weakest": 0.03}
BLUR = {"name": "motion_blur", "exposure_ms": 40.0, "stamped": "middle"}


@pytest.mark.parametrize("off_mm", [-0.15, 0.15])
def test_blurred_edges_say_where_a_part_lies(off_mm: float) -> None:
    """Over 3.2 mm of way, eight pitches, of which the part lay a third off."""
    scene, sheet = part("steps"), datasheet(100, effects=[SHADOWS])
    laser = Laser.from_datasheet(sheet)
    made = record(
        scene, sheet, [BLUR], name="r", seed=4, pitch_mm=PITCH_MM, misplaced=0.0, **VIEWS[0]
    )
    centre, shift = np.zeros(3), np.zeros(PRIOR_SD.size)
    shift[1] = off_mm
    placement = Placement(
        shift=shift, centre_mm=centre, covariance=np.eye(shift.size),
        poses=move(made.poses, shift, centre),
    )  # fmt: skip
    (patch,) = cut(0, made, placement, scene, sheet, laser, lateral_mm=0.03)
    model = Model(effects=(MotionBlur(exposure_ms=40.0, stamped="middle"),))
    placed = placed_by_law(patch, placement, model, bench_workspace("steps").noise)
    on_part = np.array([0.0, 0.0, 100.0, 1.0])
    left = ((placed.poses[:, :3] - made.poses[:, :3]) @ on_part).mean(axis=0)
    assert np.linalg.norm(left) < 0.1 * PITCH_MM
