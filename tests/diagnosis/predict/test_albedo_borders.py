"""Borders of the albedo reach as far as a line does; without a brightness there are none."""

import numpy as np

from diagnosis.predict.albedo_borders import albedo_borders
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.small_parts import datasheet, part, poses


def test_readings_within_reach_of_a_border_are_marked() -> None:
    view = View(
        part("domes"), SensorModel(datasheet(100)), poses(60, pitch_mm=0.3), np.arange(60) / 200.0,
        intensity=np.where(np.arange(60)[:, None] < 30, 0.2, 0.8) * np.ones((60, 100)),
    )
    rows = np.flatnonzero(albedo_borders(view).any(axis=1))
    assert rows.tolist() == list(range(27, 33))
    dark = View(view.scene, view.sensor, view.poses, view.time_s)
    assert not albedo_borders(dark).any()
