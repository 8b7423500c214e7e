"""Facts of a case whose fault is known."""

from dataclasses import replace

import numpy as np
import pytest

from challenge.cases.truth import facts, levelled


def test_facts_of_a_bow(bowed):
    secret, staged, _ = bowed
    known = facts(staged, secret, draws=2)
    change = known.on_mm - known.off_mm
    column = np.nanmedian(change, 0)
    bend = np.polyfit(np.linspace(-1, 1, column.size), column, 2)[0]
    assert abs(bend) > 0.02
    assert known.oracle_gain > 0.05
    assert 0.2 < known.region.mean() <= 1
    assert known.fair.mean() > 0.8
    assert known.oracle_z > 8
    assert 5 < known.noise_um < 40


def test_facts_lie_at_the_places_that_are_delivered(bowed):
    secret, staged, _ = bowed
    even = replace(staged, make=replace(staged.make, even_step=0.8))
    known = facts(even, secret, draws=2)
    assert known.on_mm.shape[1] == even.make.even_x_mm().size > staged.good.camera.columns
    whole = facts(staged, secret, draws=2)
    assert known.oracle_gain == pytest.approx(whole.oracle_gain, rel=0.5)
    assert known.region.mean() == pytest.approx(whole.region.mean(), abs=0.15)
    assert known.fair.mean() > 0.8


def test_flats_tell_no_shift():
    """A bow over two levels keeps its form beside their edge; a shifted slope is taken away."""
    rng = np.random.default_rng(5)
    rows, columns = np.indices((60, 90))
    across = (columns - 45) / 45.0
    # the camera's rays fan out: a tilt along the travel is a little less steep at the line's ends
    levels = np.where(columns < 45, 80.0, 82.0) + 0.002 * rows * (1 - 0.01 * across**2)
    bow = 0.01 * across**2 + 1e-4 * rng.standard_normal(levels.shape)
    soft = levels.copy()
    soft[:, 44:46] += 0.2 * np.array([1.0, -1.0])  # a line of finite width beside the edge
    soft[20:24] += 0.2 * (rows[20:24] - 22)  # and across it
    flat = (np.abs(columns - 45) > 6) & (np.abs(rows - 22) > 6)
    left = levelled(bow, flat, soft)
    plain = np.polynomial.polynomial.polyfit(columns[0], bow.mean(0), 1)
    expected = bow - np.polynomial.polynomial.polyval(columns, plain)
    assert np.abs(left - left[flat].mean() - expected + expected[flat].mean()).max() < 0.005

    hill = 80.0 + np.cos(rows / 9.0) * np.cos(columns / 11.0)
    moved = 0.05 * np.gradient(hill)[0]
    assert np.abs(levelled(moved, np.ones(hill.shape, bool), hill)).max() < 1e-9
