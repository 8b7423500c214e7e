"""What recordings show of the size of a component."""

import numpy as np

from diagnosis.settings import SETTINGS

SIZES = SETTINGS.mean_sizes()


def seen_as(size: float, k: int = 6, information: float = 4e4) -> np.ndarray:
    """Log factors of each size where the true coefficients are of one size."""
    pull = information * size * np.random.default_rng(round(1e6 * size)).standard_normal(k)
    v = SIZES**2 * information
    return np.array(
        [0.5 * (s**2 * pull @ pull / (1 + w)) - 0.5 * k * np.log1p(w)
         for s, w in zip(SIZES, v, strict=True)]
    )  # fmt: skip
