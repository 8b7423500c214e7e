"""An irregular closed outline: a circle with waves of low order."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ORDERS = np.arange(2, 8)


def outline(angles_rad: Floats, spread: float, rng: np.random.Generator) -> Floats:
    """Return the radius ratio of an outline about 1.

    Parameters
    ----------
    angles_rad
        (k,) where.
    spread
        Standard deviation of the radius along the outline, relative; the harmonics of order 2
        to 7 fall off with their order.
    rng
        Source of randomness.

    Returns
    -------
    ratio
        (k,), kept within 0.5 to 1.6.
    """
    strength = rng.uniform(0.3, 1.7, len(ORDERS)) / ORDERS**2
    strength *= spread / np.sqrt(np.sum(strength**2))
    phase = rng.uniform(0, 2 * np.pi, len(ORDERS))
    waves = np.cos(angles_rad[:, None] * ORDERS + phase) @ (np.sqrt(2) * strength)
    return np.asarray(np.clip(1.0 + waves, 0.5, 1.6))
