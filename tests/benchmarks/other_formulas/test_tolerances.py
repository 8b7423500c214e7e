"""Good instruments of other makers: noise as the light has it, nothing else."""

import numpy as np
import pytest

from benchmarks.other_formulas.cases import Case, nominal_shot, stage
from benchmarks.other_formulas.parts import plate
from benchmarks.other_formulas.tolerances import Tolerance, draw_tolerance, tolerated

EVEN = {
    "ends": 1.0, "middle": 0.0, "streaks": np.zeros(1), "turns": np.ones(1),
    "phases": np.zeros(1), "reach": 1e6, "outliers": 0.0, "missing": 0.0,
}  # fmt: skip


NULL = Case(name="t", kind="null", formulas=(), wanted=0, part="terraces", baselines=False,
            plate=True, seed=5)  # fmt: skip


def scale_of(tolerance):
    staged = stage(NULL)
    shot = nominal_shot(staged, staged.plate_scan, 0, plate())
    sheet = staged.instrument.sheet
    there = 2 * shot.view.x / sheet.x_fov_mm, shot.view.depth / sheet.working_distance_mm
    return tolerated(shot, tolerance).scale, *there


def test_speckle_does_not_depend_on_the_light():
    scale, *_ = scale_of(Tolerance(**EVEN | {"speckle": 1.0, "ends": 0.1}))
    assert scale == pytest.approx(1.0)


def test_photons_scatter_by_the_root_of_the_light():
    scale, u, z = scale_of(Tolerance(**EVEN | {"speckle": 0.0, "ends": 0.25}))
    light = 0.25 ** u**2 / z**2
    assert scale == pytest.approx(1 / np.sqrt(light))
    assert np.nanmax(scale) > 1.8


def test_out_of_focus_the_peak_is_wider():
    near, _, z = scale_of(Tolerance(**EVEN | {"speckle": 0.0, "reach": 0.1}))
    far, *_ = scale_of(Tolerance(**EVEN | {"speckle": 0.0}))
    sheet = stage(NULL).instrument.sheet
    off = sheet.working_distance_mm * (z - 1) / (0.1 * sheet.z_range_mm / 2)
    assert near / far == pytest.approx(np.sqrt(1 + off**2))


def test_what_is_drawn_is_within_what_makers_allow():
    rng = np.random.default_rng(1)
    for _ in range(50):
        drawn = draw_tolerance(rng)
        light = drawn.light(np.linspace(-1, 1, 200))
        assert 0.1 < light.min() <= light.max() < 2.0
        assert max(drawn.outliers, drawn.missing) <= 1e-3
