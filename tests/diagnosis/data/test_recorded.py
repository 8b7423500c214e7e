"""Recordings under study: their rays by name, patches with what is held out, registration."""

import numpy as np
import pytest

from diagnosis.data.recorded import Recorded
from diagnosis.register.placement import PRIOR_SD, Placement
from sensors.casting.laser import Laser
from tests.support.small_parts import datasheet, part, record


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    scene, sheet = part("domes"), datasheet(60)
    made = tuple(
        record(scene, sheet, [], name=name, seed=4, profiles=50, pitch_mm=0.7, misplaced=4.0)
        for name in ("a", "b")
    )
    laser = {r.name: Laser.from_datasheet(sheet) for r in made}
    held = tuple(np.full(r.depth_mm.shape, k == 1) for k, r in enumerate(made))
    return Recorded(
        recordings=made, scene=scene, datasheet=sheet, laser=laser, lateral_mm=0.03, held_out=held
    )


def as_commanded(recorded: Recorded) -> Placement:
    return Placement(
        shift=np.zeros(PRIOR_SD.size), centre_mm=np.zeros(3), covariance=np.eye(PRIOR_SD.size),
        poses=recorded.recordings[1].poses,
    )  # fmt: skip


def test_rays_are_found_by_the_recordings_name(recorded: Recorded) -> None:
    assert recorded.rays(1) is recorded.laser["b"]


def test_patches_know_what_is_held_out(recorded: Recorded) -> None:
    (patch,) = recorded.cut(1, as_commanded(recorded))
    assert (patch.recording, patch.name) == (1, "b")
    assert patch.scored.all()
    assert not patch.fit.any()


def test_a_registered_recording_lies_on_its_part(recorded: Recorded) -> None:
    made = recorded.recordings[1]
    even = np.ones(made.depth_mm.shape)
    placed = recorded.register(1, np.isfinite(made.depth_mm), 0.0 * even, 0.009, 0.009 * even)
    before, after = (
        np.nanmedian(np.abs(p.depth_mm - p.plain_mm))
        for at in (as_commanded(recorded), placed)
        for p in recorded.cut(1, at)
    )
    assert after < 0.01 < before
