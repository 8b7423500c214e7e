"""Strips of a large recording are parts of one whole: the derivative by its placement, too."""

import numpy as np

from diagnosis.data.patch import WHOLE, cut
from diagnosis.data.recorded import Recorded
from diagnosis.fields import Field
from diagnosis.localise.maps import Pieces
from diagnosis.register.placement import PRIOR_SD, Placement
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.recording import Recording
from tests.support.small_parts import datasheet, part, poses

PROFILES, POINTS = 240, 2000


def large() -> tuple[Scene, Datasheet, Laser, Recording, Placement]:
    """Return a recording that is looked at in strips, where it lies."""
    assert PROFILES * POINTS > WHOLE
    scene, sheet = part("wedge"), datasheet(POINTS)
    laser = Laser.from_datasheet(sheet)
    there = poses(
        PROFILES, tilt_deg=(9.0, -4.0), heading_deg=90.0, shift_mm=(1.5, -1.0, 3.0), pitch_mm=0.15
    )
    made = Recording(
        name="r", depth_mm=scene.cast(laser, there).depth_mm, poses=there,
        time_s=np.arange(PROFILES) / sheet.profile_rate_hz,
    )  # fmt: skip
    placement = Placement(
        shift=np.zeros(9), centre_mm=np.array([1.0, -2.0, 3.0]),
        covariance=np.diag(PRIOR_SD**2), poses=there,
    )  # fmt: skip
    return scene, sheet, laser, made, placement


def slopes(scene: Scene, laser: Laser, placement: Placement) -> Field:
    """Differences of the whole recording's depths, (n, m, 9), NaN where facets change."""
    here = scene.cast(laser, placement.poses)
    out = np.full((*here.depth_mm.shape, 9), np.nan)
    for k, step in enumerate(1e-3 * np.eye(9)):
        ahead, back = (scene.cast(laser, placement.moved_by(s * step).poses) for s in (1.0, -1.0))
        same = (ahead.triangle == here.triangle) & (back.triangle == here.triangle)
        slope = (ahead.depth_mm - back.depth_mm) / 2e-3
        out[..., k] = np.where(same, slope, np.nan)
    return out


def test_strips_have_the_derivative_by_the_whole_recordings_placement() -> None:
    # the travel of a strip counts from the recording's mean, not from the strip's own: a bowed
    # line on 2000 x 4096 readings was called a form error
    scene, sheet, laser, made, placement = large()
    wanted = slopes(scene, laser, placement)
    patches = cut(0, made, placement, scene, sheet, laser, lateral_mm=0.03)
    assert len(patches) > 1
    recorded = Recorded(
        recordings=(made,), scene=scene, datasheet=sheet, laser={"r": laser}, lateral_mm=0.03,
        held_out=(np.zeros(made.depth_mm.shape, dtype=bool),),
    )  # fmt: skip
    pieces = Pieces(recorded=recorded, number=0, placement=placement, shift=np.zeros(9))
    found = [(p.rows, p.columns) for p in patches]
    found += [(rows, pieces.columns(rows, view)) for rows, view in pieces.views()]
    for rows, columns in found:
        sure = np.isfinite(wanted[rows])
        assert sure.mean() > 0.5
        np.testing.assert_allclose(columns[sure], wanted[rows][sure], rtol=1e-3, atol=2e-4)
