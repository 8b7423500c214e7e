"""The camera's frames: light is conserved, wells spill over, noise has its variance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from challenge.instrument.coherent_image import (
    Amplitude,
    Grid,
    Lens,
    Scatterers,
    Sheet,
    add_layer,
    collect,
    taps,
)
from challenge.instrument.readout import Chip, read_out, spill

COLUMNS, ROWS, FINE = 24, 32, 3
DEPTH = 100.0
LENS = Lens(
    columns=COLUMNS, rows=ROWS, step_rad=1e-3, half_fov=0.012, focal=400.0, tan_0=0.5, side=1.0,
    base=50.0, smile=0.0, keystone=0.0, barrel=0.0,
)  # fmt: skip
SHEET = Sheet(waist=0.05, waist_z=DEPTH, rayleigh=1e6, share=0.25)
GRID = Grid(fine_c=FINE, fine_r=FINE, taps_c=taps(1.6), taps_r=taps(1.6))


def scatterers(x_mm, power, phase_rad):
    shape = (1, len(x_mm))
    return Scatterers(
        y=np.zeros(1), x=np.reshape(np.asarray(x_mm, float), shape), z=np.full(shape, DEPTH),
        power=np.full(shape, power, np.float32),
        cosine=np.reshape(np.cos(phase_rad), shape).astype(np.float32),
        sine=np.reshape(np.sin(phase_rad), shape).astype(np.float32),
        below=np.zeros((1, 1, 3), np.float32), layers=np.zeros(1),
    )  # fmt: skip


def light_of(lit, images=1):
    wide = COLUMNS * FINE + 2 * GRID.taps_c.shape[1]
    image = Amplitude(
        np.zeros((wide, ROWS * FINE), np.float32), np.zeros((wide, ROWS * FINE), np.float32),
        np.full(wide, ROWS * FINE), np.full(wide, -1),
    )  # fmt: skip
    light = np.zeros((COLUMNS, ROWS))
    add_layer(image, lit, 0, np.zeros(3), SHEET, LENS, GRID, images)
    collect(image, GRID, light)
    assert not image.real.any()
    assert not image.imag.any()
    return light


@given(st.floats(-0.9, 0.9), st.floats(0, 6.28), st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_a_scatterer_s_light_is_its_power_wherever_it_lies(x_mm, phase_rad, images):
    light = light_of(scatterers([x_mm], 2.0, [phase_rad]), images)
    assert light.sum() == pytest.approx(2.0 * SHEET.share / images, rel=1e-3)
    column, row = np.unravel_index(np.argmax(light), light.shape)
    assert abs(column - (x_mm / DEPTH / LENS.step_rad + (COLUMNS - 1) / 2)) < 1.0
    assert abs(row - (ROWS - 1) / 2) <= 1.0


@pytest.mark.parametrize(("phase_rad", "times"), [(0.0, 4.0), (np.pi / 2, 2.0), (np.pi, 0.0)])
def test_two_scatterers_in_one_place_interfere(phase_rad, times):
    """|1 + exp(iφ)|² = 2 (1 + cos φ)."""
    one = light_of(scatterers([0.1], 1.0, [0.3])).sum()
    both = light_of(scatterers([0.1, 0.1], 1.0, [0.3, 0.3 + phase_rad])).sum()
    assert both == pytest.approx(times * one, abs=1e-6)


@given(st.lists(st.floats(0, 300), min_size=9, max_size=9))
@settings(max_examples=60, deadline=None)
def test_what_a_full_pixel_spills_stays_in_its_column(middle):
    level = np.concatenate([np.zeros(40), middle, np.zeros(40)])
    before = level.sum()
    spill(level, np.empty(level.size), 100.0, 1.0)
    assert level.max() <= 100.0
    assert level.sum() == pytest.approx(before)


def test_counts_have_the_variance_of_shot_and_read_noise():
    """σ² = N + r² electrons: Poisson's, by its normal limit, and the amplifier's."""
    electrons, read_noise, rows = 900.0, 20.0, 20_000
    chip = Chip(
        electrons=np.ones(1), ambient=np.full((1, rows), 100.0), full_well=1e9,
        read_noise=read_noise, scale=1.0, bloom=0.0, kind=0, threshold=0.0, spikes=0.0, quiet=False,
    )  # fmt: skip
    level = np.empty(rows)
    light = np.full((1, rows), electrons)
    read_out(light, chip, 0, 0, level, np.empty(rows), np.random.default_rng(0))
    wanted = electrons + 100.0
    assert level.mean() == pytest.approx(wanted, rel=0.002)
    assert level.var() == pytest.approx(wanted + read_noise**2, rel=0.04)
