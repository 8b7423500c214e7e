"""Blocks: sums over them, and intervals of these sums."""


import numpy as np
import pytest

from diagnosis.model.blocks import block_of, block_sums, bootstrap_interval
from diagnosis.noise.noise_model import calibrate
from sensors.effects.stage_vibration import StageVibration

WAVE = StageVibration(amplitude_um=8.0, frequency_hz=7.0, phase_rad=0.3)


def test_sums_over_blocks_are_sums_over_the_grid() -> None:
    field = np.random.default_rng(1).standard_normal((23, 31))
    sums = block_sums(field, (5, 7)).reshape(5, 5)
    assert sums[1, 2] == pytest.approx(field[5:10, 14:21].sum())
    assert sums[4, 4] == pytest.approx(field[20:, 28:].sum())
    assert sums.sum() == pytest.approx(field.sum())


def test_the_interval_of_a_sum_is_the_normal_one_for_many_blocks() -> None:
    blocks = np.random.default_rng(2).normal(0.3, 2.0, 4000)
    low, high = bootstrap_interval(blocks, np.random.default_rng(0), draws=4000)
    half = 1.96 * blocks.std() * np.sqrt(blocks.size)
    assert (low + high) / 2 == pytest.approx(blocks.sum(), abs=0.1 * half)
    assert (high - low) / 2 == pytest.approx(half, rel=0.06)


def test_blocks_are_six_correlation_lengths_wide_where_a_recording_holds_many(
) -> None:
    rng = np.random.default_rng(3)
    white = calibrate(
        [rng.standard_normal((300, 300))], [np.ones((300, 300), dtype=bool)], pitch_mm=(1.0, 1.0),
        missing_share=0.0,
    )  # fmt: skip
    assert white.correlation_length_px() == pytest.approx((1.0, 1.0), abs=0.1)
    assert block_of((90, 90), white) == (6, 6)
    # a few dozen blocks a side are enough, and a small recording is never one block alone
    assert block_of((1600, 1600), white) == (100, 100)
    assert block_of((12, 12), white) == (2, 2)
