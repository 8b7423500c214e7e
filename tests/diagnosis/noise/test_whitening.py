"""Whitening leaves independent unit readings, beside gaps too."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from diagnosis.noise.noise_model import calibrate
from diagnosis.noise.whitening import Whitener, transposed


def correlated(rng: np.random.Generator, shape: tuple[int, int] = (160, 200)) -> np.ndarray:
    field = gaussian_filter(rng.standard_normal(shape), (0.8, 1.6), mode="wrap")
    return 0.01 * field / field.std() + 0.003 * rng.standard_normal(shape)


def test_whitened_readings_are_independent_even_beside_gaps() -> None:
    rng = np.random.default_rng(7)
    fields = [correlated(rng) for _ in range(3)]
    whole = np.ones((160, 200), bool)
    model = calibrate(
        fields, [whole] * 3, pitch_mm=(0.1, 0.1), missing_share=0.0
    )
    used = rng.random((160, 200)) > 0.2
    used[60:80, 90:120] = False
    white = Whitener.build(model, used).apply(np.where(used, fields[0] / model.sd_mm, 0.0))
    assert white[used].std() == pytest.approx(1.0, abs=0.03)
    assert np.all(white[~used] == 0)
    both = used[:, 1:] & used[:, :-1]
    assert abs(np.mean((white[:, 1:] * white[:, :-1])[both])) < 0.03


def test_transposed_whitening_is_the_adjoint() -> None:
    rng = np.random.default_rng(8)
    model = calibrate(
        [correlated(rng, (40, 50))], [np.ones((40, 50), bool)], pitch_mm=(1, 1), missing_share=0.0,
    )  # fmt: skip
    whitener = Whitener.build(model, rng.random((40, 50)) > 0.1)
    a, b = rng.standard_normal((2, 40, 50))
    left = float((whitener.apply(np.where(whitener.used, a, 0.0)) * b * whitener.used).sum())
    right = float((a * transposed(whitener, b * whitener.used)).sum())
    assert left == pytest.approx(right)
