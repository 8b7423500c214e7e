"""Centroid bias from a recorded brightness: steps, gradients, slopes, edges."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from sensors.line.line_operator import centroid_bias_mm
from sensors.line.recorded_brightness import recorded_bias_mm
from sensors.surface.reflectance import Patch, ReflectanceMap

ANGLE_DEG = 30.0
DARK, BRIGHT = 0.2, 0.9


def seen_step(y: NDArray[np.float64], border: float, sd: float) -> NDArray[np.float64]:
    """Brightness (n, m) that a Gaussian line reads across a border along it."""
    one = DARK + (BRIGHT - DARK) * ndtr((y - border) / sd)
    return np.repeat(one[:, None], 80, axis=1)


@pytest.mark.parametrize("sd", [0.01, 0.05, 0.1])
@pytest.mark.parametrize("place", [-0.9, -0.2, 0.0, 0.6])
@pytest.mark.parametrize("ahead", [1, -1])
def test_a_border_sharper_than_the_pitch_is_as_the_line_reads_it(view_of, sd, place, ahead):
    """Between profiles 0.1 mm apart: σ ΔI φ(d) / I times z / b, whichever way the sensor goes."""
    y = (0.1 * np.arange(-10, 11))[::ahead]
    view = view_of("plate", y_mm=y, intensity=seen_step(y, place * sd, sd))
    bias = recorded_bias_mm(view, sd)[:, 40]
    density = np.exp(-0.5 * np.square(y / sd - place)) / (sd * math.sqrt(2 * math.pi))
    slope = (BRIGHT - DARK) * density / view.intensity[:, 40]
    expected = sd**2 * slope * view.depth_mm[:, 40] / view.datasheet.camera_offset_mm
    assert np.allclose(bias[1:-1], expected[1:-1], atol=0.06 * np.abs(expected).max())


@pytest.mark.parametrize("sd", [0.02, 0.1, 0.4])
def test_in_a_gradient_it_is_the_squared_width_times_the_slope(view_of, sd):
    y = 0.1 * np.arange(-10, 11)
    view = view_of("plate", y_mm=y, intensity=np.repeat(0.5 + 0.3 * y[:, None], 80, axis=1))
    bias = recorded_bias_mm(view, sd)[10, 40]
    lever = view.depth_mm[10, 40] / view.datasheet.camera_offset_mm
    assert bias == pytest.approx(sd**2 * 0.3 / 0.5 * lever, rel=1e-6)


def test_it_is_what_the_line_operator_reads_of_the_part_itself(view_of):
    """On a wall at 45°, too, where the line's own depth changes across it."""
    sd, border, y = 0.06, 10.003, 0.02 * np.arange(-12, 13) + 10.0
    dark = Patch(value=DARK, x_mm=(-100.0, 100.0), y_mm=(border, 100.0))
    part = ReflectanceMap(base=BRIGHT, patches=(dark,))
    known = view_of("groove", y_mm=y, reflectance=part)
    assert abs(known.slope_y[12, 40]) == pytest.approx(1.0)
    recorded = view_of("groove", y_mm=y, intensity=BRIGHT + DARK - seen_step(y, border, sd))
    expected, bias = centroid_bias_mm(known, sd)[:, 40], recorded_bias_mm(recorded, sd)[:, 40]
    assert np.abs(expected).max() > 0.01
    # the operator's sub-lines stand half a deviation apart
    assert np.allclose(bias[2:-2], expected[2:-2], atol=0.2 * np.abs(expected).max())
    assert bias.sum() == pytest.approx(expected.sum(), rel=0.03)


def test_a_line_on_two_levels_has_none(view_of):
    y = 0.02 * np.arange(-20, 21) + 10.0
    view = view_of("step", y_mm=y, intensity=seen_step(y, 10.0, 0.05))
    near = np.abs(y - 10.0) < 0.05
    bias = recorded_bias_mm(view, 0.05)
    on_block = np.abs(view.part_mm[20, :, 0]) < 14.0
    assert not bias[np.ix_(near, on_block)].any()
    beside = np.abs(view.part_mm[20, :, 0]) > 16.0
    assert bias[np.ix_(near, beside)].all()


def test_where_brightness_is_not_known_there_is_none(view_of):
    y = 0.1 * np.arange(-10, 11)
    bright = seen_step(y, 0.0, 0.05)
    bright[10, 40] = np.nan
    view = view_of("plate", y_mm=y, intensity=bright)
    assert not recorded_bias_mm(view, 0.05)[9:12, 40].any()
    assert recorded_bias_mm(view, 0.05)[10, 41] != 0.0
