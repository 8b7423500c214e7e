"""Samples of a recording: spread over it, and refused where they miss the part."""

import dataclasses

import numpy as np
import pytest

from diagnosis.register.registration import register
from diagnosis.register.sample import READINGS, Sample, check_meets, pitch_of
from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from tests.support.small_parts import datasheet, part, record


@pytest.mark.parametrize(
    ("scale", "offset", "words"),
    [(1e-3, 0.0, "--part-unit m"), (1 / 25.4, 0.0, "--part-unit inch"), (1.0, 400.0, "overlap")],
)
def test_units_and_places_that_cannot_be(scale: float, offset: float, words: str) -> None:
    scene, sheet = part("domes"), datasheet(60)
    made = record(scene, sheet, [], name="r", seed=4, profiles=40, pitch_mm=1.0)
    wrong = Scene(scene.vertices_mm * scale + offset, scene.faces)
    laser, valid = Laser.from_datasheet(sheet), np.isfinite(made.depth_mm)
    with pytest.raises(RecipeError, match=words):
        register(wrong, made, laser, datasheet=sheet, valid=valid, sd_mm=0.003)


def test_a_sample_is_the_whole_of_a_small_recording_and_spread_over_a_large_one() -> None:
    scene, sheet = part("domes"), datasheet(60)
    made = record(scene, sheet, [], name="r", seed=4, profiles=40, pitch_mm=1.0)
    laser, valid = Laser.from_datasheet(sheet), np.isfinite(made.depth_mm)
    offset = np.full(valid.shape, 0.25)
    sample = Sample.of(scene, made, laser, valid=valid, offset_mm=offset)
    np.testing.assert_array_equal(sample.depth_mm, np.where(valid, made.depth_mm, np.nan) - 0.25)
    times = 60
    large = dataclasses.replace(
        made,
        depth_mm=np.repeat(made.depth_mm, times, axis=0),
        poses=np.repeat(made.poses, times, axis=0),
        time_s=np.arange(times * len(made.poses)) / 200.0,
    )
    taken = Sample.of(scene, large, laser, valid=np.repeat(valid, times, axis=0))
    assert 0.3 * READINGS < taken.depth_mm.size <= READINGS
    assert taken.poses[-1] == pytest.approx(made.poses[-1])


def test_a_recording_that_meets_its_part_passes() -> None:
    scene, sheet = part("domes"), datasheet(60)
    made = record(scene, sheet, [], name="r", seed=4, profiles=40, pitch_mm=1.0)
    laser, valid = Laser.from_datasheet(sheet), np.isfinite(made.depth_mm)
    check_meets(scene, made, laser, valid=valid)
    with pytest.raises(RecipeError, match="part-unit"):
        check_meets(Scene(scene.vertices_mm * 1e-3, scene.faces), made, laser, valid=valid)


def test_the_pitch_is_the_longer_side_over_the_count() -> None:
    grid = np.stack(np.meshgrid(np.arange(11.0), 0.1 * np.arange(101), [5.0]), -1).reshape(-1, 3)
    assert pitch_of(grid, (101, 11)) == pytest.approx(0.1, rel=0.02)
