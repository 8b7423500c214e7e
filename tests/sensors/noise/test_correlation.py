"""Correlation of speckle: closed form against fields that are drawn."""

import numpy as np
import pytest
from scipy.signal import fftconvolve

from sensors.noise.correlation import speckle_kernel
from sensors.noise.lay import sample_lay
from sensors.noise.perlin import PerlinField
from sensors.surface.surface import Surface

PITCH_X, PITCH_Y = 0.11, 0.2
DRAWS, SIDE = 300, 64


def fields(field, lay=(1.0, 0.0)):
    x, y = np.arange(SIDE) * PITCH_X, np.arange(SIDE) * PITCH_Y
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed + 1)
        yield field.sample(x, y, rng) if lay[0] == 1.0 else sample_lay(field, x, y, *lay, rng)


def at(kernel, row, column):
    middle = np.array(kernel.shape) // 2
    return kernel[middle[0] + row, middle[1] + column]


@pytest.mark.parametrize("lay", [(1.0, 0.0), (6.0, 0.7)])
def test_closed_form_against_drawn_fields(lay):
    field = PerlinField(amplitude_mm=1.0, cell_x_mm=0.9, cell_y_mm=0.9)
    kernel = speckle_kernel(field, PITCH_X, PITCH_Y, lay_ratio=lay[0], lay_angle_rad=lay[1])
    assert at(kernel, 0, 0) == pytest.approx(1, abs=1e-6)
    drawn = np.array(list(fields(field, lay)))
    variance = (drawn**2).mean()
    for row, column in [(0, 1), (0, 3), (1, 0), (2, 0), (2, 3), (3, -2), (1, 5)]:
        near = drawn[:, : SIDE - row, max(-column, 0) : SIDE - max(column, 0)]
        far = drawn[:, row:, max(column, 0) : SIDE - max(-column, 0)]
        assert (near * far).mean() / variance == pytest.approx(at(kernel, row, column), abs=0.02)


def test_no_variance_at_zero_frequency():
    field = PerlinField(amplitude_mm=1.0, cell_x_mm=0.9, cell_y_mm=0.7)
    kernel = speckle_kernel(field, PITCH_X, PITCH_Y)
    assert abs(kernel.sum()) < 1e-3 * np.abs(kernel).sum()  # the ramp's integral is zero


@pytest.mark.parametrize("name", ["car_door", "steel_plate", "bearing_cap"])
def test_a_surfaces_map_of_heights_is_allowed_for(name):
    sheet = {"z_resolution_um": 1.0, "repeatability_um": 0.5}
    field = Surface.load(name).ready(PITCH_X, PITCH_Y, **sheet).field()
    kernel = speckle_kernel(field, PITCH_X, PITCH_Y)
    y, x = np.mgrid[-1 : 1 : SIDE * 1j, -1 : 1 : SIDE * 1j]
    template = np.maximum(1 - (x**2 + y**2) / 0.8, 0)
    heights = np.array(list(fields(field)))
    output = (heights * template).sum(axis=(1, 2))
    predicted = heights.var() * (template * fftconvolve(template, kernel, mode="same")).sum()
    assert output.var() == pytest.approx(float(predicted), rel=0.25)  # 300 draws: 3 x 8 %
