"""What a move changes: an offset along the sensor's axis changes every reading by as much."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from diagnosis.diagnosis import Diagnosis
from diagnosis.report.move_picture import TAKEN_UP, change_um, is_taken_up, move_picture
from diagnosis.report.page import render
from diagnosis.validate.found_effects import plainly_found
from sensors.effects.pose_error import PoseError


def test_a_move_that_the_placements_hold_is_drawn(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    moved = plainly_found(PoseError.none().with_parameters({"z_mm": 0.1}), 0.0, {}, probability=0.9)
    assert is_taken_up(result, moved)
    assert not is_taken_up(result, result.effects[0])
    name, change = change_um(result, moved)
    assert name in {*result.fitted, *result.held}
    assert np.nanmedian(change) == pytest.approx(-100.0, rel=0.05)  # nearly: slopes beside a fan
    picture = move_picture(result, moved)
    assert picture is not None
    assert picture.startswith(b"\x89PNG")
    still = plainly_found(PoseError.none(), 0.0, {}, probability=0.9)
    assert move_picture(result, still) is None
    page = render(
        dataclasses.replace(result, effects=(moved,), after=result.before), part_name="bowl"
    )
    assert page.count(TAKEN_UP) == 2  # in the summary and beside the picture
    assert "leave the figures of held-out readings unchanged" in page
