"""Whitening of many fields at once is that of each by itself."""

import numpy as np
import pytest

from diagnosis.noise import NoiseModel, calibrate
from diagnosis.whitening import Whitener

SHAPE = 30, 44
SD_MM = 0.004


@pytest.fixture(scope="module")
def whitener() -> Whitener:
    rng = np.random.default_rng(5)
    noise: NoiseModel = calibrate(
        [rng.standard_normal(SHAPE)], [np.ones(SHAPE, dtype=bool)], pitch_mm=(0.1, 0.1),
        missing_share=0.0, from_reference=True,
    )  # fmt: skip
    return Whitener.build(noise, rng.random(SHAPE) > 0.2)


@pytest.fixture(scope="module")
def fields() -> np.ndarray:
    rng = np.random.default_rng(6)
    return SD_MM * rng.standard_normal((5, *SHAPE))


def one_by_one(whitener: Whitener, fields: np.ndarray, sd_mm: np.ndarray) -> np.ndarray:
    return np.stack([whitener.apply(np.where(whitener.used, f / sd_mm, 0.0)) for f in fields])


def sizes() -> np.ndarray:
    """Return the noise's size, larger from column to column."""
    return np.broadcast_to(SD_MM * np.linspace(1.0, 2.0, SHAPE[1]), SHAPE).copy()


def test_columns_and_stacks_are_fields_whitened_one_by_one(
    whitener: Whitener, fields: np.ndarray
) -> None:
    wanted = one_by_one(whitener, fields, sizes())
    columns = whitener.columns(list(fields), sizes())
    assert np.allclose(columns, wanted[:, whitener.used], atol=1e-5)
    stacked = whitener.stacked(np.moveaxis(fields, 0, -1).copy(), sizes())
    assert np.allclose(np.moveaxis(stacked, -1, 0), wanted, atol=1e-5)


def test_a_field_without_a_value_counts_as_zero_there(
    whitener: Whitener, fields: np.ndarray
) -> None:
    torn, whole = fields[0].copy(), fields[0].copy()
    torn[7, 9], whole[7, 9] = np.nan, 0.0
    found, wanted = (whitener.columns([f], sizes()) for f in (torn, whole))
    assert np.array_equal(found, wanted)


@pytest.mark.parametrize("size", [1, 3])
def test_indicators_are_groups_of_readings_whitened_one_by_one(
    whitener: Whitener, fields: np.ndarray, size: int
) -> None:
    n, m = SHAPE
    number = np.arange(m) // size
    field = fields[0] / SD_MM
    found = whitener.indicators(field, np.zeros(n, dtype=np.int64), number).toarray()
    alone = [np.where(number[None] == k, field, 0.0) for k in range(int(number[-1]) + 1)]
    wanted = one_by_one(whitener, np.stack(alone), np.ones(SHAPE))
    assert found == pytest.approx(wanted[:, whitener.used].T, abs=1e-12)
    found = whitener.indicators(field, np.arange(n), np.zeros(m, dtype=np.int64)).toarray()
    alone = [np.where(np.arange(n)[:, None] == k, field, 0.0) for k in range(n)]
    wanted = one_by_one(whitener, np.stack(alone), np.ones(SHAPE))
    assert found == pytest.approx(wanted[:, whitener.used].T, abs=1e-12)
