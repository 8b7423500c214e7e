"""Silhouettes settle what smooth faces leave open, and only that."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from diagnosis.register.placement import PRIOR_SD
from diagnosis.register.registration import register
from diagnosis.register.silhouettes import any_silhouette, open_directions
from diagnosis.settings import SETTINGS
from sensors.casting.laser import Laser
from tests.support.small_parts import datasheet, part, poses, record


def test_silhouettes_are_searched_where_there_are_some(monkeypatch: pytest.MonkeyPatch) -> None:
    searched = []

    def search(cost: Any, count: int, reaches: Any) -> Any:
        searched.append(count)
        return np.zeros(count), 0.0

    monkeypatch.setattr("diagnosis.register.silhouettes.step_by_step", search)
    every = replace(SETTINGS, register=replace(SETTINGS.register, open_pitches=0.0))
    monkeypatch.setattr("diagnosis.register.silhouettes.SETTINGS", every)
    sheet = datasheet(60)
    laser = Laser.from_datasheet(sheet)
    for name in ("domes", "steps"):
        scene = part(name)
        made = record(scene, sheet, [], name="r", seed=4, profiles=40, pitch_mm=0.5)
        valid = np.isfinite(made.depth_mm)
        register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.003)
        assert bool(searched) == (name == "steps")


def test_silhouettes_say_where_a_part_lies_before_how_the_sensor_travels() -> None:
    """A bar that smooth faces leave open along the travel, whose length they leave open, too."""
    laser = Laser.from_datasheet(datasheet(40))
    place = poses(20)
    share = np.full(9, 1e-6)
    share[[1, 6]] = 1.0, 30.0
    unsure = np.diag((share * PRIOR_SD) ** 2)
    depth = np.full((20, 40), 100.0)
    assert len(open_directions(unsure, place, laser, depth, 0.3)) == 2
    (found,) = open_directions(unsure, place, laser, depth, 0.3, travels=False)
    assert np.abs(found[1]) == pytest.approx(1.0)
    assert found[6:] == pytest.approx([0.0, 0.0, 0.0])
    together = unsure.copy()
    together[1, 6] = together[6, 1] = 0.99999 * np.sqrt(unsure[1, 1] * unsure[6, 6])
    # for a given travel the bar's place is known to a hundredth of what it is otherwise
    (given,) = open_directions(together, place, laser, depth, 0.3, travels=False)
    assert np.abs(given[1]) == pytest.approx(1.0)


def test_a_bent_face_is_no_silhouette() -> None:
    """A sphere of 30 mm bends by 0.3 pitches over a pitch of 9 mm; a step of half a pitch ends."""
    x, y = np.meshgrid(0.3 * np.arange(-20, 21), 0.3 * np.arange(-20, 21))
    bowl = 100.0 + np.sqrt(30.0**2 - x**2 - y**2)
    assert not any_silhouette(bowl, 0.3)
    assert any_silhouette(np.where(x > 0, bowl + 0.15, bowl), 0.3)
    ends = bowl.copy()
    ends[3, 4] = np.nan
    assert any_silhouette(ends, 0.3)
