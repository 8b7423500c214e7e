"""A change that a rival or a registration imitates is told from it by nothing."""

import numpy as np
import pytest

from challenge.cases.imitation import APART, difference

Y, X = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 80), indexing="ij")
FLAT = np.ones(X.shape, dtype=bool)


def test_what_a_rival_of_any_size_and_a_tilt_imitate_is_not_told():
    bow, bend = 0.02 * X**2, -0.5 * X**2
    assert difference(bow + 0.1 * Y, bend, FLAT, 0 * X, 0.02) < 1e-3


def test_a_bend_at_an_angle_is_told_by_its_twist():
    angle = np.radians(10)
    bend = 0.05 * (X * np.cos(angle) + Y * np.sin(angle)) ** 2
    told = difference(bend, X**2, FLAT, 0 * X, 0.02)
    twist = 0.05 * (2 * np.sin(angle) * np.cos(angle) * X * Y + np.sin(angle) ** 2 * Y**2)
    twist -= twist.mean()
    assert told == pytest.approx(np.sqrt((twist**2).sum() / APART) / 0.02, rel=0.05)
    # half the noise: twice as sure
    assert difference(bend, X**2, FLAT, 0 * X, 0.01) == pytest.approx(2 * told)
