"""Offsets of columns are shrunk by their own scatter, well known or not; slopes must pay."""

import numpy as np
import pytest

from diagnosis.physics.column_offsets import Columns, likely_variance
from diagnosis.settings import SETTINGS


@pytest.mark.parametrize("true", [1e-6, 1e-4, 1e-2])
def test_the_variance_of_many_coefficients_is_found(true: float) -> None:
    rng = np.random.default_rng(2)
    weights = 10 ** rng.uniform(2, 7, 2000)  # inverse variances of the noise, very uneven
    turn = np.linalg.qr(rng.standard_normal((2000, 2000)))[0]
    gram = (turn * weights) @ turn.T
    offsets = np.sqrt(true) * rng.standard_normal(2000)
    noise = turn @ (np.sqrt(weights) * rng.standard_normal(2000))
    assert likely_variance(gram, gram @ offsets + noise) == pytest.approx(true, rel=0.2)


def test_nothing_is_nothing() -> None:
    rng = np.random.default_rng(3)
    gram = 1e6 * np.eye(400)
    assert likely_variance(gram, 1e3 * rng.standard_normal(400)) < 0.2e-6


def test_what_was_not_measured_has_a_finite_variance() -> None:
    assert np.isfinite(likely_variance(np.zeros((5, 5)), np.zeros(5)))


@pytest.mark.parametrize("slope_mm", [0.0, 2e-3])
def test_columns_tilt_where_the_evidence_asks_for_it(slope_mm: float) -> None:
    """White noise: normal equations of 200 columns, each read at 150 depths."""
    rng = np.random.default_rng(4)
    away = rng.uniform(-3, 3, (200, 150))
    offsets, slopes = 5e-3 * rng.standard_normal(200), slope_mm * rng.standard_normal(200)
    noise = 0.02
    read = offsets[:, None] + slopes[:, None] * away + noise * rng.standard_normal(away.shape)
    one, two, both = np.full(200, 150.0), (away**2).sum(axis=1), away.sum(axis=1)
    gram = np.block([[np.diag(one), np.diag(both)], [np.diag(both), np.diag(two)]]) / noise**2
    right = np.concatenate([read.sum(axis=1), (away * read).sum(axis=1)]) / noise**2
    tilted = Columns(gram=gram, right=right, tilted=True)
    values, gain, evidence = tilted.shrunk()
    flat, less, plain = tilted.level().shrunk()
    if slope_mm == 0.0:
        assert evidence < plain + SETTINGS.physics.tilt_nats
        return
    assert evidence > plain + SETTINGS.physics.tilt_nats
    assert gain > less
    found, tilts = np.split(values, 2)
    # the noise of an offset is 0.02 / sqrt(150), that of a slope less by the depths' 1.7 mm
    assert np.std(found - offsets) < 1.2 * 1.64e-3
    assert np.std(tilts - slopes) < 1.2 * 0.95e-3
    assert np.std(flat - offsets) > np.std(found - offsets)
